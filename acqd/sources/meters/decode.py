"""Registers as numbers: types, word order, "not available"."""

from __future__ import annotations

import math
import struct

from acqd.sources.meters.profile import Profile, Register

_FORMAT = {
    "u16": ">H", "i16": ">h", "u32": ">I", "i32": ">i", "u64": ">Q", "i64": ">q", "float32": ">f", "float64": ">d",
}  # fmt: skip


def raw_value(register: Register, data: bytes) -> int:
    """The register's bits as an unsigned number, words put in order."""
    if register.word_order == "low":
        data = b"".join(data[k : k + 2] for k in range(len(data) - 2, -1, -2))
    return int.from_bytes(data, "big")


def number(register: Register, data: bytes) -> float:
    """Value x scale of the register's bytes; may be NaN or infinite."""
    bits = raw_value(register, data)
    [value] = struct.unpack(_FORMAT[register.type], bits.to_bytes(2 * register.width, "big"))
    return float(value) * register.scale


def quantity(profile: Profile, register: Register, data: bytes) -> float | None:
    """The quantity, None where the meter says "not available"."""
    raw = raw_value(register, data)
    if raw in register.unavailable or (register.width > 1 and raw in profile.unavailable):
        return None
    value = number(register, data)
    return value if math.isfinite(value) else None
