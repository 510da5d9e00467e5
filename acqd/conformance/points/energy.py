"""IEC 62053-21 and -22: errors of the energy register of rows, at reference conditions and under influence."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from acqd.arrays import Floats
from acqd.conformance import limits
from acqd.conformance.instrument import Instrument
from acqd.conformance.point import Limit, Point, judged
from acqd.conformance.signal import Envelope, Mains, Signal, balanced
from acqd.conformance.terminal import Terminal

CLASS_05S = "IEC 62053-22, class 0.5 S"
CLASS_1 = "IEC 62053-21, class 1"
_SETTLED = 5
"""Windows before the first reading."""
_MOST_SECONDS = 10
_BURST_CYCLES = 4
_RISE_S = 200e-6
"""In which a phase-fired current rises: a choke limits it, and no converter sees what is between its samples."""


def errors(instrument: Instrument) -> Iterator[Point]:
    """Balanced load, class 0.5 S."""
    yield from _table(instrument, CLASS_05S, limits.ENERGY_05S, household=False)


def household_errors(instrument: Instrument) -> Iterator[Point]:
    """Balanced load, class 1, and a load of a single phase."""
    yield from _table(instrument, CLASS_1, limits.ENERGY_1, household=True)
    terminal = instrument.terminal
    mains = replace(_load(terminal, 1.0, 1.0), I=(terminal.nominal_current, 0.0, 0.0))
    yield _point(instrument, CLASS_1, "energy, single phase", f"load of L1 only, {_words(1.0, 1.0)}", mains,
                 limits.SINGLE_PHASE)  # fmt: skip


def influences(instrument: Instrument) -> Iterator[Point]:
    """Influence quantities, one at a time."""
    terminal = instrument.terminal
    U, nominal = terminal.declared_voltage, float(terminal.f_nominal)
    base = _load(terminal, 1.0, 1.0)
    half = _load(terminal, 0.5 * terminal.max_current / terminal.nominal_current, 1.0)
    inductive = _load(terminal, 1.0, 0.5)
    cases: list[tuple[str, Mains]] = []
    for share in (0.9, 1.1):
        cases.append((f"voltage {100 * share:g} % of Un, pf 1", replace(base, U=balanced(share * U))))
        cases.append((f"voltage {100 * share:g} % of Un, pf 0.5", replace(inductive, U=balanced(share * U))))
    for share in (0.98, 1.02):
        cases.append((f"frequency {share * nominal:g} Hz, pf 1", replace(base, f=share * nominal)))
        cases.append((f"frequency {share * nominal:g} Hz, pf 0.5", replace(inductive, f=share * nominal)))
    tenth = _load(terminal, 0.1, 1.0)
    cases.append(("reversed phase sequence, 0.1 In", replace(tenth, sequence=-1)))
    cases.append(("one voltage missing", replace(base, U=(U, U, 0.0))))
    cases.append(("two voltages missing", replace(base, U=(U, 0.0, 0.0))))
    fifth = replace(half, harmonics={5: (0.1 * U, 0.0)}, current_harmonics={5: (0.4 * half.I[0], 0.0)})
    cases.append(("H5 of 10 % (U) and 40 % (I), 0.5 Imax", fifth))
    cases.append(("bursts: two cycles on, two off", replace(half, current_envelope=_bursts(nominal))))
    cases.append(
        (
            f"phase-fired at 90 degrees, rise in {_RISE_S * 1e6:.0f} us",
            replace(half, current_envelope=_phase_fired(nominal)),
        )
    )
    small = _load(terminal, 0.5 * terminal.max_current / terminal.nominal_current / np.sqrt(2), 1.0)
    cases.append(
        ("half waves: direct current and even harmonics", replace(small, current_envelope=_half_waves(nominal)))
    )
    for text, mains in cases:
        limit = limits.influenced(0.6 if mains.lag else 0.5)
        yield _point(instrument, CLASS_05S, "energy, influence quantities", text, mains, limit)


def no_load_and_start(instrument: Instrument) -> Iterator[Point]:
    """Nothing is registered without a current at 115 % of Un; 0.1 % of In is."""
    terminal = instrument.terminal
    U = balanced(1.15 * terminal.declared_voltage)
    mains = Mains(float(terminal.f_nominal), U)
    signal = Signal("115 % of Un, no current, 10 s", mains, 10.0)
    W = instrument.read(signal, "rows").row("W", "total")
    counted = 1e3 * (np.abs(W).max() if len(W) else np.nan)
    yield judged(CLASS_05S, "no load", signal.text, "register", limits.NO_LOAD, [counted])
    current = 0.001 * terminal.nominal_current
    mains = Mains(float(terminal.f_nominal), balanced(terminal.declared_voltage), balanced(current))
    yield _point(instrument, CLASS_05S, "starting current", "0.1 % of In, pf 1", mains, limits.STARTING, 10)


def _table(
    instrument: Instrument, standard: str, table: tuple[tuple[float, float, float], ...], *, household: bool
) -> Iterator[Point]:
    terminal = instrument.terminal
    for share, factor, allowed in table:
        named = share
        if share > 1:  # Imax
            named = terminal.max_current / terminal.nominal_current
        mains, limit = _load(terminal, named, factor), limits.energy(allowed, household)
        yield _point(instrument, standard, "energy, balanced load", _words(named, factor), mains, limit)


def _load(terminal: Terminal, share: float, factor: float) -> Mains:
    """`share` of In at a power factor; negative: capacitive."""
    lag = float(np.sign(factor) * np.arccos(abs(factor)))
    return Mains(
        float(terminal.f_nominal),
        balanced(terminal.declared_voltage),
        balanced(share * terminal.nominal_current),
        lag,
    )


def _words(share: float, factor: float) -> str:
    kind = "" if abs(factor) == 1 else " inductive" if factor > 0 else " capacitive"
    return f"{share:.3g} In, power factor {abs(factor):g}{kind}"


def _point(
    instrument: Instrument, standard: str, parameter: str, text: str, mains: Mains, limit: Limit, seconds: int = 1
) -> Point:
    """Energy of at least so many seconds of whole windows and whole cycles, against that of the wave."""
    window = instrument.terminal.window
    together = 1 if mains.current_envelope is None else _BURST_CYCLES
    while abs(math.remainder(mains.f * seconds, together)) > 1e-6 and seconds < _MOST_SECONDS:
        seconds += 1
    W = instrument.read(Signal(text, mains, seconds + 10 * window), "rows").row("W", "total")
    windows = round(seconds / window)
    if len(W) <= _SETTLED + windows:
        return judged(standard, parameter, text, "energy of all phases", limit, [])
    kWh = W[_SETTLED + windows] - W[_SETTLED]
    truth = mains.power(round(mains.f * 0.5 / _BURST_CYCLES) * _BURST_CYCLES / mains.f) * seconds / 3.6e6
    return judged(standard, parameter, text, "energy of all phases", limit, [100 * (kWh / truth - 1)])


def _bursts(f: float) -> Envelope:
    def envelope(t: Floats, phase: int) -> Floats:  # noqa: ARG001 - all phases together
        return (np.floor(t * f + 1e-9) % _BURST_CYCLES < _BURST_CYCLES / 2).astype(np.float64)

    return envelope


def _phase_fired(f: float) -> Envelope:
    """Conducting from the peak of the voltage (a cosine at angle 0) to its zero crossing, in both half cycles."""

    def envelope(t: Floats, phase: int) -> Floats:
        since = (2 * (t * f - phase / 3)) % 1.0 / (2 * f)  # s since a peak
        return np.clip(since / _RISE_S, 0.0, 1.0) * (since < 0.25 / f)

    return envelope


def _half_waves(f: float) -> Envelope:
    def envelope(t: Floats, phase: int) -> Floats:
        return (np.cos(2 * np.pi * (t * f - phase / 3)) > 0).astype(np.float64)

    return envelope
