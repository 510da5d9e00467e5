"""LeCroy .trc: one trace behind a WAVEDESC block (template LECROY_2_3, LeCroy's Remote Control Manual)."""

from __future__ import annotations

import struct
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from acqd.errors import InputError
from acqd.sources.recording.channel import Recording
from acqd.sources.scopes.shot import Trace, check_step, recording_of, stored
from acqd.sources.waveform import ChannelMap

_MAGIC = b"WAVEDESC"
_LEAST = 346  # bytes of the block
_PREFIX = 64  # bytes in which the block begins, behind the length of a transfer


def load(path: Path, given: ChannelMap) -> Recording:
    """A trace, with those of the other channels beside it. Raises InputError."""
    del given
    return recording_of(path, "LeCroy .trc", _read)


def _read(path: Path) -> list[Trace]:
    with path.open("rb") as file:
        head = file.read(_PREFIX + _LEAST)
    at = head[:_PREFIX].find(_MAGIC)
    if at < 0 or len(head) < at + _LEAST:
        raise InputError(path, "is truncated or no LeCroy trace (no WAVEDESC block)")
    block, available = head[at : at + _LEAST], path.stat().st_size - at
    template = block[16:32].rstrip(b"\0 ").decode("ascii", errors="replace")
    if template != "LECROY_2_3":
        raise InputError(path, f"has the template {template!r}, expected LECROY_2_3; save as ASCII in the oscilloscope")
    order = "<" if block[34] == 1 else ">"

    def number(kind: str, place: int) -> Any:
        return struct.unpack_from(order + kind, block, place)[0]

    segments, points = number("i", 144), number("i", 116)
    if segments > 1:
        raise InputError(path, f"holds {segments} segments of sequence mode; save one segment, or one long trace")
    lengths = [number("i", place) for place in (36, 40, 44, 48, 52)]  # what stands before the samples
    size = number("i", 60)
    wide = number("h", 32) == 1
    begin = sum(lengths)
    if min(lengths) < 0 or begin < _LEAST or size <= 0 or begin + size > available:
        raise InputError(path, f"is truncated: announces {begin + size} bytes, has {available}")
    there = size // (2 if wide else 1)
    if not 0 < points <= there:
        raise InputError(path, f"announces {points} samples, has {there}")
    codes = stored(path, f"{order}i2" if wide else "i1", points, at + begin)
    gain, offset = number("f", 156), number("f", 160)
    unit = block[196:244].split(b"\0")[0].decode("latin-1").strip()
    step, origin = (
        check_step(path, float(str(np.float32(number("f", 176))))),
        number("d", 180),
    )  # 1e-6, not 9.99999997e-7
    if not np.isfinite([gain, offset, origin]).all() or abs(origin) > 1e6:
        raise InputError(path, f"has gain {gain:g}, offset {offset:g} and start {origin:g} s; is it damaged?")
    source = number("h", 344)
    name = f"C{source + 1}" if 0 <= source < 4 else path.stem
    start = _start(block[296:312], order, origin)
    return [Trace(name, unit, points, codes, gain, -offset, step, origin, start)]


def _start(stamp: bytes, order: str, origin_s: float) -> int | None:
    """UTC of the first sample [ns] from the time of the trigger; None for none."""
    seconds, minutes, hours, days, months, year = struct.unpack(order + "dbbbbh", stamp[:14])
    if not 1990 < year < 2200 or not 0 <= seconds < 60:
        return None
    try:
        minute = datetime(year, months, days, hours, minutes, tzinfo=UTC)
    except ValueError:
        return None
    return int(minute.timestamp()) * 10**9 + round((float(seconds) + origin_s) * 1e9)
