"""IEC/IEEE 60255-118-1, class P: total vector error, and errors of f and ROCOF, of the synchrophasors."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from acqd.arrays import Floats
from acqd.conformance import limits
from acqd.conformance.instrument import Instrument, PhasorSeries
from acqd.conformance.point import Limit, Point, judged
from acqd.conformance.signal import Mains, Signal, balanced

STANDARD = "IEC 60255-118-1, class P"
_EXCLUDED = 2
"""Reports beside the ends of a ramp that do not count."""
_MODULATION = 0.1
_PLACES = 8
Truth = Callable[[Floats], Floats]


def steady(instrument: Instrument) -> Iterator[Point]:
    """Frequency, magnitude, and a harmonic of 1 %."""
    terminal = instrument.terminal
    nominal, U = float(terminal.f_nominal), terminal.declared_voltage
    for f in (nominal - 2, nominal - 1, nominal, nominal + 1, nominal + 2):
        mains = Mains(f, balanced(U))
        yield from _judged(instrument, f"{f:g} Hz, Udin", mains, 0.6, limits.PHASOR_STEADY)
    for share in (0.8, 1.2):
        mains = Mains(nominal, balanced(share * U))
        yield from _judged(instrument, f"{100 * share:g} % of Udin", mains, 0.6, limits.PHASOR_STEADY)
    for order in (2, 3, 5, 7, 25, 50):
        mains = Mains(nominal, balanced(U), harmonics={order: (0.01 * U, 0.7)})
        yield from _judged(instrument, f"H{order} of 1 %", mains, 0.6, limits.PHASOR_STEADY)


def dynamic(instrument: Instrument) -> Iterator[Point]:
    """Modulation of magnitude and phase, ramps of f, steps of magnitude and phase."""
    terminal = instrument.terminal
    nominal, U = float(terminal.f_nominal), balanced(terminal.declared_voltage)
    for f_m in (0.5, 2.0):
        swing = 2 * np.pi * f_m
        mains = Mains(nominal, U, envelope=lambda t, _, w=swing: 1 + _MODULATION * np.cos(w * t))  # type: ignore[misc]
        yield from _judged(instrument, f"magnitude swings by 10 % at {f_m:g} Hz", mains, 2.2, limits.PHASOR_MODULATED)
        mains = Mains(nominal, U, turn=lambda t, w=swing: _MODULATION * np.cos(w * t - np.pi))  # type: ignore[misc]
        yield from _judged(
            instrument, f"phase swings by 0.1 rad at {f_m:g} Hz", mains, 2.2, limits.PHASOR_MODULATED,
            lambda t, w=swing, m=f_m: nominal - _MODULATION * m * np.sin(w * t - np.pi),  # type: ignore[misc]
            lambda t, w=swing, m=f_m: -_MODULATION * w * m * np.cos(w * t - np.pi),  # type: ignore[misc]
        )  # fmt: skip
    for slope in (1.0, -1.0):
        mains = Mains(nominal - 2 * slope, U, slope=slope)
        yield from _judged(
            instrument, f"f from {nominal - 2 * slope:g} to {nominal + 2 * slope:g} Hz, {slope:+g} Hz/s", mains, 4.0,
            limits.PHASOR_RAMP,
            lambda t, s=slope: nominal - 2 * s + s * t,  # type: ignore[misc]
            lambda t, s=slope: np.full_like(t, s),  # type: ignore[misc]
        )  # fmt: skip
    yield from _steps(instrument)


def _steps(instrument: Instrument) -> Iterator[Point]:
    """For how long the error is beyond 1 % around a step, which lies at several places between two reports."""
    terminal = instrument.terminal
    nominal = float(terminal.f_nominal)
    plain = Mains(nominal, balanced(terminal.declared_voltage))
    for text in ("magnitude steps by 10 %", "phase steps by 10 degrees"):
        beyond: list[float] = []
        for place in range(_PLACES):
            at = (20 + place / _PLACES) / nominal
            stepped = replace(plain, envelope=lambda t, _, at=at: np.asarray(1 + 0.1 * (t >= at)))  # type: ignore[misc]
            if text.startswith("phase"):
                stepped = replace(plain, turn=lambda t, at=at: np.asarray(np.pi / 18 * (t >= at)))  # type: ignore[misc]
            series = instrument.phasors(Signal(text, stepped, 40 / nominal))
            beyond += (series.t[_tve(stepped, series, nominal) > 1.0] - at).tolist()
        lasted = (max(beyond) - min(beyond)) * nominal
        yield judged(STANDARD, "step response", text, "time with more than 1 % TVE", limits.PHASOR_RESPONSE, [lasted])


def _judged(
    instrument: Instrument, text: str, mains: Mains, seconds: float, allowed: tuple[Limit, Limit, Limit],
    true_f: Truth | None = None, true_rocof: Truth | None = None,
) -> Iterator[Point]:  # fmt: skip
    nominal = float(instrument.terminal.f_nominal)
    series = instrument.phasors(Signal(text, mains, seconds)).inner(_EXCLUDED)
    f = true_f(series.t) if true_f else mains.f
    rocof = true_rocof(series.t) if true_rocof else 0.0
    errors = (_tve(mains, series, nominal), series.f - f, series.rocof - rocof)
    for quantity, limit, error in zip(("TVE", "frequency error", "ROCOF error"), allowed, errors, strict=True):
        yield judged(STANDARD, "synchrophasor (not in rows)", text, quantity, limit, [error])


def _tve(mains: Mains, series: PhasorSeries, nominal: float) -> Floats:
    """Total vector error of the positive sequence in %."""
    angle = mains.angle(series.t) - 2 * np.pi * nominal * series.t
    size = np.full_like(series.t, mains.U[0])
    if mains.envelope is not None:
        size = size * mains.envelope(series.t, 0)
    truth = size * np.exp(1j * angle)
    return np.asarray(100 * np.abs(series.positive - truth) / np.abs(truth))
