"""Tektronix .wfm: one trace behind a fixed header (Tektronix, Reference Waveform File Format, 077-0220).

Versions WFM#001 to WFM#003 differ by two fields, which move what follows them. The samples are read when somebody asks.
"""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np

from acqd.errors import InputError
from acqd.sources.scopes.shot import Trace, channel_name, check_step, stored

_VERSIONS = {b":WFM#001": (166, 4), b":WFM#002": (168, 4), b":WFM#003": (168, 8)}
"""Where the first explicit dimension begins, and the bytes of a point density."""
_ORDERS = {b"\x0f\x0f": "<", b"\xf0\xf0": ">"}
_FORMATS = ("i2", "i4", "u4", "u8", "f4", "f8", "u1", "i1")
_EXPLICIT, _IMPLICIT, _VIEW = 100, 76, 52
"""Bytes of a dimension, and of its user view without the density."""
_TIMEBASES, _UPDATE, _CURVE = 24, 24, 30
_SINGLE, _VECTOR = 0, 2
_PAIRS = (b"IQ_centerFrequency", b"IQ_sampleRate", b"IQ_span")
_ADVICE = "save as .csv in the oscilloscope"


def is_tektronix(path: Path) -> bool:
    """Whether a .wfm begins like one of these."""
    with path.open("rb") as file:
        return _known(file.read(10))


def _known(head: bytes) -> bool:
    return head[:2] in _ORDERS and head[2:10] in _VERSIONS


def read(path: Path) -> list[Trace]:
    """The trace. Raises InputError."""
    with path.open("rb") as file:
        head = file.read(1024)
    if not _known(head):  # the file of another channel decided how these are read
        raise InputError(path, f"does not begin as a Tektronix waveform; {_ADVICE}")
    order, (explicit, density) = _ORDERS[head[:2]], _VERSIONS[head[2:10]]
    implicit = explicit + 2 * (_EXPLICIT + _VIEW + density)
    curve = implicit + 2 * (_IMPLICIT + _VIEW + density) + _TIMEBASES + _UPDATE
    if len(head) < curve + _CURVE:
        raise InputError(path, f"is truncated: its header has {curve + _CURVE} bytes")

    def number(kind: str, place: int) -> Any:
        return struct.unpack_from(order + kind, head, place)[0]

    frames = number("I", 72) + 1
    if frames > 1 or number("i", 78) != _SINGLE:
        raise InputError(path, f"holds {frames} frames of FastFrame; save one frame, or one long trace")
    if number("i", 122) != _VECTOR:
        raise InputError(path, f"holds digital lines, a picture or a measurement, not samples; {_ADVICE}")
    code, width = number("I", explicit + 72), head[15]
    if code >= len(_FORMATS) or np.dtype(_FORMATS[code]).itemsize != width:
        raise InputError(path, f"has samples of format {code} in {width} bytes, which is unknown; {_ADVICE}")
    begin, end = number("I", curve + 14), number("I", curve + 18)
    buffer, available = number("i", 16), path.stat().st_size
    if not curve + _CURVE <= buffer or begin >= end or buffer + end > available:
        raise InputError(path, f"is truncated or damaged: announces {buffer + end} bytes, has {available}")
    with path.open("rb") as file:
        file.seek(buffer + end)
        behind = file.read(1 << 16)
        if any(name in behind for name in _PAIRS):
            raise InputError(path, f"holds pairs of I and Q, not samples of a voltage; {_ADVICE}")
    scale, offset, step, origin = (number("d", at) for at in (explicit, explicit + 8, implicit, implicit + 8))
    if not np.isfinite([scale, offset, origin]).all() or not scale:
        raise InputError(path, f"has scale {scale:g}, offset {offset:g} and start {origin:g} s; is it damaged?")
    unit = head[explicit + 20 : explicit + 40].split(b"\0")[0].decode("latin-1").strip()
    label = head[40:72].split(b"\0")[0].decode("latin-1")
    samples = (end - begin) // width
    codes = stored(path, order + _FORMATS[code], samples, buffer + begin)
    return [Trace(channel_name(label, path), unit, samples, codes, scale, offset, check_step(path, step), origin)]
