"""Traces of one trigger as a recording. Instruments that write one file a channel need several for a power."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from acqd.errors import InputError
from acqd.sources.recording.channel import Channel, Column, Recording
from acqd.sources.recording.siblings import SAME_STEP, channel_number, siblings, skew


@dataclass(frozen=True, slots=True)
class Trace:
    """The samples of one channel: value = codes x scale + offset, in the unit."""

    name: str
    unit: str
    samples: int
    codes: Callable[[], Any]
    """Numbers [samples], read when somebody asks: those of one channel are in memory at a time."""
    scale: float
    offset: float
    step_s: float
    origin_s: float = 0.0
    """Of the first sample, since the trigger."""
    start_utc_ns: int | None = None


def recording_of(path: Path, title: str, read: Callable[[Path], list[Trace]]) -> Recording:
    """The traces of a file; of a file with one trace also those of the same trigger beside it. Raises InputError."""
    traces, notes = read(path), []
    if len(traces) == 1:
        names = [path.name]
        for other in siblings(path):
            more = read(other)
            if abs(more[0].step_s / traces[0].step_s - 1) > SAME_STEP or more[0].samples != traces[0].samples:
                notes.append(f"{other.name} has another length or rate: left out")
                continue
            traces += more
            names.append(other.name)
        if len(names) > 1:
            notes.append(f"read together with it: {', '.join(names[1:])}")
    traces.sort(key=lambda trace: trace.name)
    first = traces[0]
    channels = [Channel(one.name, one.unit, skew_s=skew(one.origin_s - first.origin_s, first.step_s)) for one in traces]
    if any(trace.start_utc_ns is not None for trace in traces):
        notes.append("its stamps name no time zone; taken as UTC")
    advice = "give the file of the voltage, with that of the current beside it (CH1, CH2 in the names)"
    return Recording(
        path, title, channels, first.samples, lambda k: _column(traces[k]), 1 / first.step_s, first.start_utc_ns,
        notes=notes, noun="channel", advice=advice if len(traces) == 1 else "",
    )  # fmt: skip


def _column(trace: Trace) -> Column:
    return Column(trace.codes(), trace.scale, trace.offset)


def channel_name(label: str, path: Path) -> str:
    """`CH2` where the label or the name of the file says a channel; else the name of the file."""
    said = re.search(r"(?i)\bch(\d)\b", label)
    number = said[1] if said else channel_number(path)
    return f"CH{number}" if number else path.stem


def stored(path: Path, kind: str, samples: int, offset: int) -> Callable[[], Any]:
    """Reads numbers of a `kind` of numpy from byte `offset` of a file on."""
    return lambda: np.fromfile(path, kind, samples, offset=offset)


def check_step(path: Path, step_s: float) -> float:
    """The step if one is possible. Raises InputError."""
    if not 1e-15 < step_s < 1e3:
        raise InputError(path, f"its samples are {step_s:g} s apart; is it damaged?")
    return step_s
