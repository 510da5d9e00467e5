"""IEC 62586-2 and IEC 61000-4-30, class A: dips, swells and interruptions."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from acqd.arrays import Floats
from acqd.conformance import limits
from acqd.conformance.instrument import Instrument
from acqd.conformance.point import Point, judged
from acqd.conformance.points.quality import STANDARD
from acqd.conformance.signal import START_NS, Envelope, Mains, Signal, balanced
from acqd.conformance.terminal import Terminal

_EPOCH_TICKS = 116_444_736_000_000_000  # FILETIME of 1970
_HOLDS_A_CYCLE = 1.5
"""Cycles of an event that holds a whole cycle of Urms(1/2) at every instant of its begin."""


@dataclass(frozen=True, slots=True)
class Disturbance:
    """One event of a signal."""

    begin: float
    """s."""
    cycles: float
    share: float
    """Of Udin that is left (or there)."""
    phases: tuple[int, ...] = (0, 1, 2)


def _envelope(events: Sequence[Disturbance], f: float) -> Envelope:
    def envelope(t: Floats, phase: int) -> Floats:
        factor = np.ones_like(t)
        for event in events:
            if phase in event.phases:
                factor[(t >= event.begin) & (t < event.begin + event.cycles / f)] = event.share
        return factor

    return envelope


def example(terminal: Terminal) -> Signal:
    """For a picture: a dip of one phase."""
    f, events = float(terminal.f_nominal), (Disturbance(0.06, 2.5, 0.4, (1,)),)
    mains = Mains(f, balanced(terminal.declared_voltage), envelope=_envelope(events, f))
    return Signal("40 % of Udin for 2.5 cycles in L2", mains, 0.2)


def dips_and_swells(instrument: Instrument) -> Iterator[Point]:
    """Depths and lengths, from one cycle on, at instants spread over the cycle."""
    shapes = [(0.85, 10.0), (0.7, 1.0), (0.5, 2.5), (0.4, 30.0), (0.1, 5.0)]
    yield from _judged(instrument, "dips", "dip", shapes, (0, 1, 2))
    yield from _judged(instrument, "dips", "dip", [(0.6, 1.0), (0.3, 8.0)], (1,))
    yield from _judged(instrument, "swells", "swell", [(1.2, 1.0), (1.15, 10.0), (1.45, 3.0)], (0, 1, 2))


def interruptions(instrument: Instrument) -> Iterator[Point]:
    """Of all phases; one of two phases is a dip."""
    yield from _judged(instrument, "interruptions", "interruption", [(0.0, 5.0), (0.02, 25.0)], (0, 1, 2))
    yield from _judged(instrument, "interruptions", "dip", [(0.0, 10.0)], (0, 2))


def _judged(
    instrument: Instrument, parameter: str, kind: str, shapes: Sequence[tuple[float, float]], phases: tuple[int, ...]
) -> Iterator[Point]:
    terminal = instrument.terminal
    f, declared = terminal.f_nominal * 1.0031, terminal.declared_voltage
    begin, events = 0.5, list[Disturbance]()
    for number, (share, cycles) in enumerate(shapes):
        events.append(Disturbance(begin + 0.0037 * number, cycles, share, phases))
        begin += cycles / f + 0.4
    mains = Mains(f, balanced(declared), envelope=_envelope(events, f))
    listed = ", ".join(f"{100 * share:g} % for {cycles:g} cycles" for share, cycles in shapes)
    signal = Signal(f"{f:.4g} Hz, {len(phases)} phases at {listed}", mains, begin + 0.2)
    found = [one for one in instrument.read(signal, "events").events if one["kind"] == kind]
    found = [one for one in found if one["duration"] is not None]
    yield judged(STANDARD, parameter, signal.text, "number", limits.COUNT, [len(found) - len(events)])
    pairs = list(zip(found, events, strict=False)) if len(found) == len(events) else []
    residual = [
        100 * (one["extreme"] / declared - event.share) for one, event in pairs if event.cycles >= _HOLDS_A_CYCLE
    ]
    quantity = "highest Urms(1/2)" if kind == "swell" else "residual voltage"
    quantity += f", of {_HOLDS_A_CYCLE:g} cycles and more"
    yield judged(STANDARD, parameter, signal.text, quantity, limits.RESIDUAL, [residual])
    duration = [one["duration"] * f - event.cycles for one, event in pairs]
    yield judged(STANDARD, parameter, signal.text, "duration", limits.DURATION, [duration])
    start = [((one["filetime"] - _EPOCH_TICKS) * 1e-7 - START_NS * 1e-9 - event.begin) * f for one, event in pairs]
    yield judged(STANDARD, parameter, signal.text, "time of the start", limits.START, [start])
