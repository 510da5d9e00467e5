"""Where meters hold their values, as their makers document it. Names: U1 [V], I1 [A], P [W], S [VA], f [Hz], kWh.

Sources: Eastron SDM630/SDM72/SDM120 Modbus protocol; Carlo Gavazzi EM340 communication protocol; ABB B23/B24 user
manual; Schneider iEM3000 user manual; Shelly API documentation (EM and EMData, "Modbus registers").
"""

from __future__ import annotations

import struct
from dataclasses import dataclass

_PACK = {"f32": ">f", "i16": ">h", "u16": ">H", "i32": ">i", "u32": ">I", "i64": ">q", "u64": ">Q"}


@dataclass(frozen=True, slots=True)
class Field:
    """One value: address from 0, type, and what one digit is worth (in V, A, W, VA, Hz, kWh or 1)."""

    name: str
    address: int
    kind: str
    unit: float = 1.0

    @property
    def count(self) -> int:
        """Registers that the value takes."""
        return struct.calcsize(_PACK[self.kind]) // 2

    def encode(self, value: float) -> list[int]:
        """Words of the value, high word first."""
        digits = value / self.unit
        packed = struct.pack(_PACK[self.kind], digits if self.kind == "f32" else round(digits))
        return list(struct.unpack(f">{self.count}H", packed))

    def decode(self, words: list[int]) -> float:
        """What the words say."""
        (digits,) = struct.unpack(_PACK[self.kind], struct.pack(f">{self.count}H", *words))
        return float(digits) * self.unit


@dataclass(frozen=True, slots=True)
class Layout:
    """A model: its values, the functions that read them, and whether the low word comes first."""

    fields: tuple[Field, ...]
    functions: tuple[int, ...]
    low_word_first: bool = False
    alone: tuple[tuple[int, int], ...] = ()
    """(address, value) of registers that say this only when read by themselves."""


def _phases(name: str, addresses: tuple[int, ...], kind: str, unit: float = 1.0) -> tuple[Field, ...]:
    return tuple(Field(f"{name}{phase}", address, kind, unit) for phase, address in enumerate(addresses, 1))


_SDM630 = Layout(
    (
        *_phases("U", (0x00, 0x02, 0x04), "f32"),
        *_phases("I", (0x06, 0x08, 0x0A), "f32"),
        *_phases("P", (0x0C, 0x0E, 0x10), "f32"),
        *_phases("S", (0x12, 0x14, 0x16), "f32"),
        *_phases("PF", (0x1E, 0x20, 0x22), "f32"),
        Field("P", 0x34, "f32"),
        Field("S", 0x38, "f32"),
        Field("PF", 0x3E, "f32"),
        Field("f", 0x46, "f32"),
        Field("import_kwh", 0x48, "f32"),
        Field("export_kwh", 0x4A, "f32"),
    ),
    (4,),
)
_SDM120 = Layout(
    (
        Field("U1", 0x00, "f32"),
        Field("I1", 0x06, "f32"),
        Field("P1", 0x0C, "f32"),
        Field("S1", 0x12, "f32"),
        Field("PF1", 0x1E, "f32"),
        Field("f", 0x46, "f32"),
        Field("import_kwh", 0x48, "f32"),
        Field("export_kwh", 0x4A, "f32"),
    ),
    (4,),
)
_EM340 = Layout(
    (
        *_phases("U", (0x00, 0x02, 0x04), "i32", 0.1),
        *_phases("I", (0x0C, 0x0E, 0x10), "i32", 0.001),
        *_phases("P", (0x12, 0x14, 0x16), "i32", 0.1),
        *_phases("S", (0x18, 0x1A, 0x1C), "i32", 0.1),
        Field("P", 0x28, "i32", 0.1),
        Field("S", 0x2A, "i32", 0.1),
        *_phases("PF", (0x2E, 0x2F, 0x30), "i16", 0.001),
        Field("PF", 0x31, "i16", 0.001),
        Field("f", 0x33, "i16", 0.1),
        Field("import_kwh", 0x34, "i32", 0.1),
        Field("export_kwh", 0x4E, "i32", 0.1),
    ),
    (3, 4),
    low_word_first=True,
    alone=((0x000B, 341),),
)
_B23 = Layout(
    (
        Field("import_kwh", 0x5000, "u64", 0.01),
        Field("export_kwh", 0x5004, "u64", 0.01),
        *_phases("U", (0x5B00, 0x5B02, 0x5B04), "u32", 0.1),
        *_phases("I", (0x5B0C, 0x5B0E, 0x5B10), "u32", 0.01),
        Field("P", 0x5B14, "i32", 0.01),
        *_phases("P", (0x5B16, 0x5B18, 0x5B1A), "i32", 0.01),
        Field("S", 0x5B24, "i32", 0.01),
        *_phases("S", (0x5B26, 0x5B28, 0x5B2A), "i32", 0.01),
        Field("f", 0x5B2C, "u16", 0.01),
        Field("PF", 0x5B3A, "i16", 0.001),
        *_phases("PF", (0x5B3B, 0x5B3C, 0x5B3D), "i16", 0.001),
    ),
    (3,),
)
_IEM3155 = Layout(
    (
        *_phases("I", (0x0BB7, 0x0BB9, 0x0BBB), "f32"),
        *_phases("U", (0x0BD3, 0x0BD5, 0x0BD7), "f32"),
        *_phases("P", (0x0BED, 0x0BEF, 0x0BF1), "f32", 1000.0),
        Field("P", 0x0BF3, "f32", 1000.0),
        Field("S", 0x0C03, "f32", 1000.0),
        Field("PF", 0x0C0B, "f32"),
        Field("f", 0x0C25, "f32"),
        Field("import_kwh", 0x0C83, "i64", 0.001),
    ),
    (3,),
)
_PRO_3EM = Layout(
    (
        Field("P", 1013, "f32"),
        Field("S", 1015, "f32"),
        *_phases("U", (1020, 1040, 1060), "f32"),
        *_phases("I", (1022, 1042, 1062), "f32"),
        *_phases("P", (1024, 1044, 1064), "f32"),
        *_phases("S", (1026, 1046, 1066), "f32"),
        *_phases("PF", (1028, 1048, 1068), "f32"),
        Field("import_kwh", 1162, "f32", 0.001),
        Field("export_kwh", 1164, "f32", 0.001),
    ),
    (4,),
    low_word_first=True,
)
LAYOUTS: dict[str, Layout] = {
    "sdm630": _SDM630,
    "sdm72": _SDM630,
    "sdm120": _SDM120,
    "em340": _EM340,
    "b23": _B23,
    "iem3155": _IEM3155,
    "pro3em": _PRO_3EM,
}
