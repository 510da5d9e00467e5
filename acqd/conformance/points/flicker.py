"""IEC 61000-4-15: the test signals of tables 1 and 5 for the lamp and the frequency of the terminal."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from acqd.arrays import Floats
from acqd.conformance import limits
from acqd.conformance.flicker_tables import RECTANGULAR, SINUSOIDAL
from acqd.conformance.instrument import Instrument
from acqd.conformance.point import Point, judged
from acqd.conformance.signal import START_NS, Mains, Signal, balanced
from acqd.conformance.terminal import Terminal
from acqd.metering.quality.flicker_values import lamp_of

STANDARD = "IEC 61000-4-15, class F1"
_PHASES = ("L1", "L2", "L3")
_SETTLING_S, _PST_S = 60, 600
_SIGNALS = 6
"""Of table 5; the seventh changes with every half cycle of the mains, and depends on the instant of the change."""


def _system(instrument: Instrument) -> tuple[str, int]:
    return lamp_of(instrument.terminal.declared_voltage), instrument.terminal.f_nominal


def example(terminal: Terminal) -> Signal:
    """For a picture: a fluctuation of the strongest visible kind, ten times as large as the just visible one."""
    change = np.array((8.8, 2.5))
    return Signal("sinusoidal fluctuation of 2.5 % at 8.8 Hz", _mains(terminal, [change], "sinusoidal"), 0.4)


def _mains(terminal: Terminal, modulations: Sequence[Floats], shape: str) -> Mains:
    """Three phases, each with a modulation (Hz or changes per minute, and relative change in %)."""

    def envelope(t: Floats, phase: int) -> Floats:
        rate, percent = modulations[phase % len(modulations)]
        if shape == "sinusoidal":
            return np.asarray(1 + percent / 200 * np.sin(2 * np.pi * rate * t))
        return np.asarray(1 + percent / 200 * np.where(np.floor(t * rate / 60 + 1e-9) % 2 == 0, 1.0, -1.0))

    # The tables hold for the lamp's voltage; relative changes are the same for any declared voltage.
    return Mains(float(terminal.f_nominal), balanced(terminal.declared_voltage), envelope=envelope)


def pinst(instrument: Instrument) -> Iterator[Point]:
    """The largest Pinst of every sinusoidal fluctuation of table 1 is 1; three signals at a time."""
    table = list(SINUSOIDAL[_system(instrument)].items())
    lamp, nominal = _system(instrument)
    found: list[tuple[float, float]] = []
    for k in range(0, len(table), 3):
        three = [np.array(pair) for pair in table[k : k + 3]]
        signal = Signal("", _mains(instrument.terminal, three, "sinusoidal"), 20.0)
        Pinst = instrument.pinst(signal)
        late = Pinst[:, Pinst.shape[1] // 2 :].max(axis=1)
        found += [(float(one[0]), 100 * (float(value) - 1)) for one, value in zip(three, late, strict=False)]
    for low, high in ((0.0, 4.0), (4.0, 8.8), (8.8, 18.0), (18.0, 50.0)):
        errors = [error for hertz, error in found if low < hertz <= high]
        text = f"{lamp} {nominal} Hz, sinusoidal, {len(errors)} signals of table 1 above {low:g} to {high:g} Hz"
        yield judged(STANDARD, "Pinst", text, "largest Pinst (not in rows)", limits.PST, [errors])


class PstPoints:
    """Pst of ten minutes is 1: three signals of table 5 at a time."""

    def __init__(self, first: int) -> None:
        """`first`: number of the first signal."""
        self._first = first

    def __call__(self, instrument: Instrument) -> Iterator[Point]:
        """Feed the instrument for ten minutes, and a minute more before the tick."""
        lamp, nominal = _system(instrument)
        table = list(RECTANGULAR[_system(instrument)].items())[:_SIGNALS]
        three = [np.array(pair) for pair in table[self._first : self._first + 3]]
        begin = START_NS - _SETTLING_S * 10**9
        signal = Signal("", _mains(instrument.terminal, three, "rectangular"), _SETTLING_S + _PST_S + 1.5, begin)
        readings = instrument.read(signal, "flicker")
        for (per_minute, percent), name in zip(three, _PHASES, strict=True):
            whole = [row["Pst"] for row in readings.aggregated("Pst", name) if "gap" not in row["flags"]]
            text = f"{lamp} {nominal} Hz, rectangular, {per_minute:g} changes a minute of {percent:g} %, 10 min"
            errors = 100 * (np.array(whole, dtype=np.float64) - 1)
            yield judged(STANDARD, "Pst", text, "Pst", limits.PST, [errors])
