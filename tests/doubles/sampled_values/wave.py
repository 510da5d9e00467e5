"""Samples that the merging unit sends: int32 digits computed from the sample number, so that a test knows each."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

U_V_PER_DIGIT = 0.01
"""IEC 61850-9-2LE and IEC 61869-9: 10 mV primary per digit."""
I_A_PER_DIGIT = 0.001
"""IEC 61850-9-2LE and IEC 61869-9: 1 mA primary per digit."""
CHANNELS = ("Ia", "Ib", "Ic", "In", "Ua", "Ub", "Uc", "Un")
"""Order on the wire."""


class Wave(Protocol):
    """What a stream can send."""

    neutral_derived: bool
    """True where In and Un are calculated sums, not measurements."""
    phases: int

    def codes(self, first: int, count: int) -> NDArray[np.int32]:
        """int32 [count, 2 * phases]: U1, I1, U2, I2, ... of the samples `first`, `first` + 1, ..."""
        ...

    def channels(self, first: int, count: int) -> NDArray[np.int32]:
        """int32 [count, 8]: the same samples in the order of `CHANNELS`."""
        ...


def wire_order(table: NDArray[np.int32]) -> NDArray[np.int32]:
    """int32 [count, 8] in the order of `CHANNELS` from U1, I1, ... [count, 2 * phases]; the neutrals are the sums."""
    phases = table.shape[1] // 2
    wire = np.zeros((len(table), 8), dtype=np.int32)
    wire[:, :phases], wire[:, 4 : 4 + phases] = table[:, 1::2], table[:, 0::2]
    wire[:, 3], wire[:, 7] = wire[:, :3].sum(axis=1), wire[:, 4:7].sum(axis=1)
    return wire


def repeated(table: NDArray[np.int32], first: int, count: int) -> NDArray[np.int32]:
    """Rows `first` ... of a table that repeats without end."""
    start = first % len(table)
    if start + count <= len(table):
        return table[start : start + count]
    return np.take(table, np.arange(first, first + count) % len(table), axis=0)


class SvWave:
    """Mains of a constant frequency with noise, as int32 digits; the counterpart of `waveform.WaveTable`.

    The waveform repeats after `seconds`, without a jump. The noise makes each sample of that
    time distinguishable: a lost, repeated or swapped frame changes the digits.
    """

    neutral_derived = True

    def __init__(
        self,
        rate: float = 4800.0,
        phases: int = 3,
        *,
        seconds: float = 10.0,
        f: float = 50.0,
        volts: float = 10e3 / 3**0.5,
        amperes: float = 40.0,
        lag: float = 0.4,
        u_scale: float = U_V_PER_DIGIT,
        i_scale: float = I_A_PER_DIGIT,
        seed: int = 1,
    ) -> None:
        """`rate` [1/s]; `f` [Hz] must fit whole cycles into `seconds`; `volts`, `amperes` rms, primary, per phase;
        `lag` [rad] of the current; scales in V and A per digit. Raises ValueError where the time does not fit.
        """
        if abs(f * seconds - round(f * seconds)) > 1e-9 or abs(rate * seconds - round(rate * seconds)) > 1e-9:
            raise ValueError(f"{seconds} s holds no whole number of cycles of {f} Hz or of samples at {rate} Hz")
        self.rate, self.phases, self.f = rate, phases, f
        self.scale: tuple[float, ...] = (u_scale, i_scale) * phases
        self.Vrms, self.Irms, self.P = volts, amperes, volts * amperes * float(np.cos(lag))
        count = round(rate * seconds)
        random = np.random.default_rng(seed)
        table = np.empty((count, 2 * phases), dtype=np.int32)
        angle = 2 * np.pi * f / rate * np.arange(count)
        for phase in range(phases):
            shift = 2 * np.pi * phase / 3
            u = np.sqrt(2) * volts * np.cos(angle - shift) / u_scale
            i = np.sqrt(2) * amperes * np.cos(angle - shift - lag) / i_scale
            table[:, 2 * phase] = np.rint(u + random.normal(0, 8, count))
            table[:, 2 * phase + 1] = np.rint(i + random.normal(0, 8, count))
        self._table = table
        self._wire = wire_order(table)

    def codes(self, first: int, count: int) -> NDArray[np.int32]:
        """int32 [count, 2 * phases]: U1, I1, U2, I2, ... of the samples `first`, `first` + 1, ..."""
        return repeated(self._table, first, count)

    def channels(self, first: int, count: int) -> NDArray[np.int32]:
        """int32 [count, 8] in the order of `CHANNELS`; the channels of absent phases are 0."""
        return repeated(self._wire, first, count)
