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
    """The quantity, None where the meter says "not available" or shows an overflow."""
    raw = raw_value(register, data)
    if raw in register.unavailable or (register.width > 1 and raw in profile.unavailable) or _is_mark(register, raw):
        return None
    value = number(register, data)
    return value if math.isfinite(value) else None


def _is_mark(register: Register, raw: int) -> bool:
    """Whether the bits are an end stop of their type: makers write these for "not available" and for an overflow.

    Signed: the largest and the smallest number, and in 32 bits everything with 0x7FFF or 0x8000 in the high word (a
    display that overflows counts on in the low word). Unsigned: all bits high, and in 32 bits 0x7FFFFFFF and
    0x80000000. All bits high of a signed type is -1: `rounds` judges that by the other registers.
    """
    bits = 16 * register.width
    top, sign = (1 << bits) - 1, 1 << bits - 1
    if register.type.startswith("i"):
        return raw in (sign, sign - 1) or (bits == 32 and raw >> 16 in (0x7FFF, 0x8000))
    if register.type.startswith("u"):
        return raw == top or (bits == 32 and raw in (sign, sign - 1))
    return False
