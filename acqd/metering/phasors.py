"""Phasors of the fundamentals of all channels, means over tens of cycles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acqd.arrays import Floats

FLOATING = 0.5
"""Of the median of the voltages: below it a phase is missing or picks up its neighbours."""


@dataclass(frozen=True, slots=True)
class Phasors:
    """Fundamentals, complex [phases]: V and A, RMS; the first voltage that is there has the angle 0."""

    U: np.ndarray
    I: np.ndarray  # noqa: E741

    def angles_deg(self) -> Floats:
        """[phases] by which each current lags its voltage."""
        return np.asarray(np.degrees(np.angle(self.U * self.I.conj())))


def phasors(values: Floats, rate: float, f: float) -> Phasors:
    """Of physical samples [samples, 2 * phases] at `rate` [1/s], mains of `f` [Hz]: means over tens of cycles.

    Each piece of ten cycles is turned so that U1, or the first voltage that is there, has the angle 0: f need not be
    exact.
    """
    length = round(10 * rate / f)
    pieces = max(1, len(values) // length)
    total = np.zeros(values.shape[1], dtype=complex)
    for k in range(pieces):
        x = values[k * length : (k + 1) * length]
        angle = 2 * np.pi * f / rate * np.arange(len(x))[:, None]
        x = np.sqrt(2) / len(x) * (x - x.mean(axis=0))
        # no product of matrices: threads of BLAS cost milliseconds beside real-time processes
        lines = (x * np.cos(angle)).sum(axis=0) - 1j * (x * np.sin(angle)).sum(axis=0)
        size = np.abs(lines[0::2])
        reference = 2 * int(np.argmax(size >= FLOATING * size.max()))  # the angle of a missing voltage is noise
        total += lines * np.exp(-1j * np.angle(lines[reference]))
    return Phasors(total[0::2] / pieces, total[1::2] / pieces)
