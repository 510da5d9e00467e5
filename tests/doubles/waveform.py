"""Samples that every double sends: computed from the sample number, so that a test knows each of them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

U_V_PER_DIGIT = 737.2575 / 32768
"""EL3783: measuring-range end value / 32768 [V]."""
I_A_PER_DIGIT = 9.207527 / 32768
"""EL3783 in the 5 A range [A]."""


class WaveTable:
    """Mains of a constant frequency with noise, as int16 codes in the order U1, I1, U2, I2, U3, I3.

    The waveform repeats after `seconds`, without a jump. The noise makes each sample of that
    time distinguishable: a lost, repeated or swapped block changes the codes.
    """

    def __init__(
        self,
        rate: float = 20_000.0,
        phases: int = 3,
        *,
        seconds: float = 10.0,
        f: float = 50.0,
        volts: float = 230.0,
        amperes: float = 2.0,
        lag: float = 0.4,
        u_scale: float = U_V_PER_DIGIT,
        i_scale: float = I_A_PER_DIGIT,
        seed: int = 1,
    ) -> None:
        """`f` [Hz] must fit whole cycles into `seconds`; `lag` [rad] of the current; scales in V and A per digit."""
        if abs(f * seconds - round(f * seconds)) > 1e-9 or abs(rate * seconds - round(rate * seconds)) > 1e-9:
            raise ValueError(f"{seconds} s holds no whole number of cycles of {f} Hz or of samples at {rate} Hz")
        self.rate = rate
        self.phases = phases
        self.scale: tuple[float, ...] = (u_scale, i_scale) * phases
        self.Vrms, self.Irms, self.P, self.f = volts, amperes, volts * amperes * float(np.cos(lag)), f
        count = round(rate * seconds)
        random = np.random.default_rng(seed)
        table = np.empty((count, 2 * phases), dtype=np.int16)
        angle = 2 * np.pi * f / rate * np.arange(count)
        for phase in range(phases):
            shift = 2 * np.pi * phase / 3
            u = np.sqrt(2) * volts * np.cos(angle - shift) / u_scale
            i = np.sqrt(2) * amperes * np.cos(angle - shift - lag) / i_scale
            table[:, 2 * phase] = np.rint(u + random.normal(0, 8, count))
            table[:, 2 * phase + 1] = np.rint(i + random.normal(0, 8, count))
        self._table = table

    def codes(self, first: int, count: int) -> NDArray[np.int16]:
        """int16 [count, 2 * phases]: the samples with numbers `first`, `first` + 1, ..."""
        size = len(self._table)
        start = first % size
        if start + count <= size:
            return self._table[start : start + count]
        return np.take(self._table, np.arange(first, first + count) % size, axis=0)
