"""What a recording holds: a table of its channels with the first readings, the choice, or why there is none."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from acqd.errors import InputError
from acqd.sources.recording.build import waveform_of
from acqd.sources.recording.channel import Recording, Role
from acqd.sources.recording.roles import roles_of
from acqd.sources.recording.selection import chosen, mapped
from acqd.sources.recording.suggestion import suggestion
from acqd.sources.recording.units import UnknownUnitError, unit_of
from acqd.sources.recording.wired import wired
from acqd.sources.waveform import ChannelMap, Waveform

_FIRST = 3  # readings that are shown
_LOOK = 200_000  # samples of which mean and RMS are


@dataclass(frozen=True, slots=True)
class InspectedChannel:
    """One line of the table."""

    number: int
    name: str
    unit: str
    role: str
    key: str
    """u1, i1 ... of a channel that is metered; else empty."""
    evidence: tuple[str, ...]
    first: tuple[float, ...] = ()
    """First readings, in V and A where the unit says so, else in the unit of the file."""
    mean: float | None = None
    rms: float | None = None


@dataclass(slots=True)
class Inspected:
    """A file."""

    file: str
    format: str
    rate: float | None
    """Samples/s; null where nothing says."""
    samples: int
    start_utc_ns: int | None
    channels: list[InspectedChannel] = field(default_factory=list)
    map: str = ""
    """--map of the channels that are metered, or a proposal where none can be chosen."""
    refusal: str = ""
    """Why the file cannot be metered as it is; empty: it can."""
    notes: list[str] = field(default_factory=list)
    wiring: list[str] = field(default_factory=list)
    """What the phasors say of the wiring, with the correction."""
    phasors: dict[str, Any] = field(default_factory=dict)
    """Of three phases, as in the status of a daemon."""


def inspect(recording: Recording, given: ChannelMap) -> tuple[Inspected, Waveform | None]:
    """The table, and the waveform that would be metered."""
    roles = roles_of(recording.channels)
    keys: dict[int, str] = {}
    result = Inspected(str(recording.path), recording.format, given.rate or recording.rate, recording.samples, None)
    try:
        selection = mapped(recording, given) if given.columns is not None else chosen(recording, roles)
        keys = {channel: key for key, channel in selection.keys}
        order = sorted(selection.keys, key=lambda one: (one[0][1:], one[0][0] == "i"))
        result.map = "--map " + ",".join(f"{key}={channel}" for key, channel in order)
    except InputError as error:
        result.map, result.refusal = suggestion(recording.channels, roles), str(error)
    result.channels = [_channel(recording, k, role, keys.get(k, "")) for k, role in enumerate(roles)]
    waveform = None
    if not result.refusal:
        try:
            waveform = waveform_of(recording, given)
        except InputError as error:
            result.refusal = str(error)
    if waveform is not None:
        found = wired(waveform)
        result.phasors, result.wiring = found.as_dict()["phasors"], [one.remedy for one in found.findings]
    result.start_utc_ns = waveform.start_utc_ns if waveform else recording.start_utc_ns
    result.notes = list(waveform.notes if waveform else recording.notes)
    return result, waveform


def _channel(recording: Recording, k: int, role: Role, key: str) -> InspectedChannel:
    channel = recording.channels[k]
    try:
        column = recording.column(k)
        unit = _factor(channel.unit) * channel.ratio
        values = column.values[:_LOOK].astype(np.float64) * (column.scale * unit) + column.offset * unit
    except (InputError, ValueError, IndexError):
        return InspectedChannel(k, channel.name, channel.unit, role.title(), key, role.evidence)
    first = tuple(float(value) for value in values[:_FIRST])
    mean, rms = (float(values.mean()), float(np.sqrt((values**2).mean()))) if len(values) else (None, None)
    return InspectedChannel(k, channel.name, channel.unit, role.title(), key, role.evidence, first, mean, rms)


def _factor(unit: str) -> float:
    try:
        found = unit_of(unit)
    except UnknownUnitError:
        return 1.0
    return found.factor if found is not None else 1.0
