"""Tektronix .isf: the waveform preamble (WFMPre) as text, and the curve (Tektronix Programmer Manual, WFMOutpre)."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from acqd.errors import InputError
from acqd.numerals import whole_number
from acqd.sources.recording.channel import Recording
from acqd.sources.scopes.shot import Trace, channel_name, check_step, recording_of, stored
from acqd.sources.waveform import ChannelMap

_CURVE = re.compile(rb"(?i):?CURVE?\s+(?:#(\d))?")
_HEAD = 8192  # bytes in which the curve begins
_KEYS = {
    "bytes": "BYT_NR", "kind": "BN_FMT", "order": "BYT_OR", "encoding": "ENCDG", "label": "WFID", "points": "NR_PT",
    "form": "PT_FMT", "step": "XINCR", "zero_x": "XZERO", "offset_x": "PT_OFF", "unit": "YUNIT", "scale": "YMULT",
    "offset_y": "YOFF", "zero_y": "YZERO",
}  # fmt: skip
"""What the preamble says. Instruments shorten the words: YUN for YUNIT."""
_SHORTEST = 3
_MUST = ("step", "scale", "offset_y", "zero_y")


def load(path: Path, given: ChannelMap) -> Recording:
    """A trace, with those of the other channels beside it. Raises InputError."""
    del given
    return recording_of(path, "Tektronix .isf", _read)


def _read(path: Path) -> list[Trace]:
    with path.open("rb") as file:
        head = file.read(_HEAD)
    found = _CURVE.search(head)
    if found is None:
        raise InputError(path, "is truncated or no Tektronix .isf (no :CURVE)")
    said = _preamble(head[: found.start()].decode("latin-1"))
    missing = [_KEYS[key] for key in _MUST if key not in said]
    if missing:
        raise InputError(path, f"its preamble lacks {', '.join(missing)}; save as .csv in the oscilloscope")
    if said.get("form", "Y").upper().startswith("ENV"):
        raise InputError(path, "holds an envelope (minimum and maximum), not samples; save in sample or high-res mode")
    samples, codes = _codes(path, head, found, said)
    points = said.get("points", "")
    expected = whole_number(points)
    if expected is not None and samples < expected:
        raise InputError(path, f"is truncated: {samples} of {expected} samples")
    values = {key: _number(path, key, said[key]) for key in _MUST}
    step = check_step(path, values["step"])
    origin = (_number(path, "zero_x", said.get("zero_x", "0"))
              - step * _number(path, "offset_x", said.get("offset_x", "0")))  # fmt: skip
    offset = values["zero_y"] - values["scale"] * values["offset_y"]
    name = channel_name(said.get("label", ""), path)
    return [Trace(name, said.get("unit", ""), samples, codes, values["scale"], offset, step, origin)]


def _preamble(text: str) -> dict[str, str]:
    said: dict[str, str] = {}
    for item in re.findall(r'(?:[^;"]|"[^"]*")+', text):
        key, _, value = item.strip().rpartition(":")[2].partition(" ") if '"' not in item else _quoted(item)
        for name, word in _KEYS.items():
            if len(key) >= _SHORTEST and word.startswith(key.upper()):
                said[name] = value.strip().strip('"').strip()
    return said


def _quoted(item: str) -> tuple[str, str, str]:
    """Of `:WFMP:WFID "Ch1, 10:1"`: a colon in the text is no end of the key."""
    key, _, value = item.strip().partition(" ")
    return key.rpartition(":")[2], " ", value


def _codes(path: Path, head: bytes, found: re.Match[bytes], said: dict[str, str]) -> tuple[int, Callable[[], Any]]:
    """How many samples, and what reads them."""
    digits = found.group(1)
    if digits is None or said.get("encoding", "BIN").upper().startswith("ASC"):
        curve = path.read_bytes()[found.end() :]
        try:
            values = np.array([float(one) for one in curve.decode("ascii").strip().rstrip(";").split(",")])
        except ValueError:
            raise InputError(path, "its curve is no list of numbers") from None
        return len(values), lambda: values
    count = int(digits)
    length = head[found.end() : found.end() + count]
    if not count or not length.isdigit():
        raise InputError(path, "does not say how long its curve is")
    wide = said.get("bytes", "1")
    kind = f"{'u' if said.get('kind', 'RI').upper() == 'RP' else 'i'}{wide}"
    if wide not in ("1", "2"):
        raise InputError(path, f"has {wide} bytes a sample, expected 1 or 2")
    if said.get("kind", "RI").upper() not in ("RI", "RP"):
        raise InputError(path, f"has samples of kind {said['kind']}, expected RI or RP")
    begin = found.end() + count
    available = path.stat().st_size - begin
    if available < int(length):
        raise InputError(path, f"is truncated: {available} of {int(length)} bytes")
    order = "<" if said.get("order", "MSB").upper() == "LSB" else ">"
    samples = int(length) // int(wide)
    return samples, stored(path, order + kind, samples, begin)


def _number(path: Path, key: str, text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        raise InputError(path, f"{_KEYS[key]} is {text!r}, expected a number")
    return value
