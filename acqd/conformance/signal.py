"""Test signals: three-phase mains whose quantities are known, as functions of time."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np

from acqd.arrays import Floats

START_NS = 1_750_000_200 * 10**9
"""UTC of the first sample, unless a signal says otherwise: a ten-minute tick, and a whole 10 s."""
_ROOT2 = float(np.sqrt(2))
Three: TypeAlias = tuple[float, float, float]
Envelope: TypeAlias = Callable[[Floats, int], Floats]
"""Factor of a phase (0, 1, 2) at times [s]."""


@dataclass(frozen=True, slots=True)
class Mains:
    """Voltages and currents of three phases; angles in rad, magnitudes are RMS values."""

    f: float
    """Hz."""
    U: Three
    """V, of the fundamentals."""
    I: Three = (0.0, 0.0, 0.0)  # noqa: E741 - the symbol of the quantity
    """A, of the fundamentals."""
    lag: float = 0.0
    """By which the currents lag; negative where they lead."""
    slope: float = 0.0
    """Hz/s: change of f."""
    harmonics: Mapping[int, tuple[float, float]] = field(default_factory=dict)
    """Of the voltages: order: V and angle."""
    current_harmonics: Mapping[int, tuple[float, float]] = field(default_factory=dict)
    """Order: A and angle."""
    tones: Mapping[float, float] = field(default_factory=dict)
    """Hz: V of an interharmonic or a signal, in phase in all voltages."""
    current_tones: Mapping[float, float] = field(default_factory=dict)
    """Hz: A."""
    sequence: int = 1
    """-1: L1-L3-L2."""
    envelope: Envelope | None = None
    """Of the voltages."""
    current_envelope: Envelope | None = None
    """Of the currents."""
    turn: Callable[[Floats], Floats] | None = None
    """Angle [rad] added to that of all fundamentals at times [s]."""

    def angle(self, t: Floats) -> Floats:
        """Of the voltage of L1 [rad], a cosine."""
        angle: Floats = 2 * np.pi * (self.f * t + self.slope * t * t / 2)
        return angle if self.turn is None else angle + self.turn(t)

    def __call__(self, t: Floats) -> Floats:
        """V and A at times `t` [samples] in s: U1, I1, U2, I2, U3, I3 as [samples, 6]."""
        samples, angle = np.empty((len(t), 6)), self.angle(t)
        for k in range(3):
            of_phase = angle - self.sequence * 2 * np.pi * k / 3
            u = self.U[k] * np.cos(of_phase) + _harmonics(self.harmonics, of_phase) + _tones(self.tones, t)
            i = self.I[k] * np.cos(of_phase - self.lag) + _tones(self.current_tones, t)
            i += _harmonics(self.current_harmonics, of_phase) * (self.I[k] > 0)
            if self.envelope is not None:
                u = u * self.envelope(t, k)
            if self.current_envelope is not None:
                i = i * self.current_envelope(t, k)
            samples[:, 2 * k], samples[:, 2 * k + 1] = u * _ROOT2, i * _ROOT2
        return samples

    def power(self, seconds: float) -> float:
        """Mean power of all phases [W] over the first seconds, from instants 10 us apart."""
        t = np.asarray((np.arange(round(seconds * 1e5)) + 0.5) * 1e-5, dtype=np.float64)
        samples = self(t)
        return float((samples[:, 0::2] * samples[:, 1::2]).sum(axis=1).mean())


@dataclass(frozen=True, slots=True)
class Signal:
    """What is fed to the instrument."""

    text: str
    """In words, for the sheet."""
    wave: Callable[[Floats], Floats]
    """V and A [samples, 6] at times [samples] in s since the first sample."""
    seconds: float
    start_ns: int = START_NS
    """UTC of the first sample."""


def balanced(value: float) -> Three:
    """The same in all phases."""
    return value, value, value


def _harmonics(harmonics: Mapping[int, tuple[float, float]], angle: Floats) -> Floats:
    return sum((size * np.cos(h * angle + turned) for h, (size, turned) in harmonics.items()), np.zeros_like(angle))


def _tones(tones: Mapping[float, float], t: Floats) -> Floats:
    return sum((size * np.cos(2 * np.pi * f * t) for f, size in tones.items()), np.zeros_like(t))
