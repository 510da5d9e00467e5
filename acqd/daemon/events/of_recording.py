"""Voltage events of recordings, as JSON lines."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np
from pydantic import ValidationError

from acqd.daemon.events.section import EventsSection, Watched
from acqd.errors import UserError, in_our_words
from acqd.metering import WindowBatch
from acqd.metering.block import SampleBlock, StreamFormat
from acqd.metering.quality.event import Event
from acqd.telemetry.event import event_lines, message_of
from acqd.telemetry.row import CHANNELS

_KEYS = ("dip", "swell", "interruption", "hysteresis", "rapid_change", "transient")


@dataclass(frozen=True, slots=True)
class EventSettings:
    """Where to write events, and what is one."""

    out: Path
    section: EventsSection


def event_settings(
    out: Path | None, declared: str | None, thresholds: str | None, *, line_to_line: bool = False
) -> EventSettings | None:
    """Settings of the options --events, --declared-voltage, --thresholds and --line-to-line. Raises UserError."""
    if out is None:
        if declared or thresholds or line_to_line:
            raise UserError("--declared-voltage, --thresholds and --line-to-line are for --events FILE; give that too")
        return None
    if declared is None:
        raise UserError("--events needs --declared-voltage: V (such as 230), or sliding where nobody has declared it")
    known: dict[str, object] = {"enabled": True, "line_to_line": line_to_line, **_thresholds(thresholds or "")}
    if declared == "sliding":
        known["sliding_reference"] = True
    else:
        known["declared_voltage"] = _number("--declared-voltage", declared)
    try:
        section = EventsSection.model_validate(known)
    except ValidationError as error:
        fault = error.errors()[0]
        key = ".".join(map(str, fault["loc"])).replace("_", "-")
        raise UserError(f"--{key or 'thresholds'}: {in_our_words(fault['msg'])}") from None
    return EventSettings(out, section)


_SUPPLY = (0.85, 1.15)
"""EN 50160, 4.2.2: means of 10 minutes stay within -15 and +10 % of the declared voltage."""


def doubt_of_voltage(path: Path, section: EventsSection, batch: WindowBatch) -> list[str]:
    """A hint where no window of a phase has about the declared voltage: then that is probably not what was declared.

    A recording that begins or ends outside of a fault has such windows; phases without a voltage are not judged.
    """
    declared = section.declared_voltage
    if declared is None or section.sliding_reference:
        return []
    usual = declared / math.sqrt(3) if section.line_to_line else declared
    for phase, volts in enumerate(batch.Vrms):
        share = volts[volts > usual * section.interruption / 100] / usual
        if len(share) and not np.any((share >= _SUPPLY[0]) & (share <= _SUPPLY[1])):
            typical = float(np.median(share))
            return [
                f"{path}: no window of {CHANNELS[phase]} has about the declared voltage: usually {usual * typical:.4g} "
                f"V, {100 * typical:.0f} % of {usual:.4g} V; is --declared-voltage {declared:g} right?"
            ]
    return []


class EventWriter:
    """Writes the events of one recording that have ended."""

    def __init__(
        self, settings: EventSettings, form: StreamFormat, device: str, boot: str, out: BinaryIO, first: int = 0
    ) -> None:
        """`first`: events of earlier recordings."""
        self._watched = Watched(settings.section, form, first)
        self._device, self._boot, self._out = device, boot, out
        self._count = first

    def take(self, block: SampleBlock) -> None:
        """Write the events that end in `block`."""
        self._write(self._watched.feed(block))

    def finish(self) -> int:
        """Write the events that are not over when the recording ends. How many there are, with earlier recordings."""
        self._write(self._watched.finish())
        return self._count

    def _write(self, events: Iterable[Event]) -> None:
        ended = [event for event in events if event.end is not None]
        self._count += len(ended)
        lines = [message_of(event, self._device, self._boot, sliding=self._watched.sliding) for event in ended]
        self._out.write(event_lines(lines))


def _thresholds(text: str) -> dict[str, float]:
    """`dip=90,swell=110` as numbers. Raises UserError."""
    found = {}
    for item in filter(None, text.split(",")):
        key, equals, value = (part.strip() for part in item.partition("="))
        if not equals or key not in _KEYS:
            raise UserError(f"--thresholds: {item!r} is not like dip=90 (keys {', '.join(_KEYS)})")
        found[key] = _number("--thresholds", value)
    return found


def _number(option: str, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise UserError(f"{option} {text!r}: expected a number") from None
