"""The lamps, eyes and brains of IEC 61000-4-15: constants of the weighting filter, and its calibration."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from acqd.metering.quality.linear_filter import Section, bilinear, butterworth

LampName = Literal["230V", "120V"]
HIGH_PASS = 0.05
"""Hz."""
SMOOTHING = 0.3
"""s: time constant of the perception."""
_CALIBRATION = 8.8  # Hz, at which the tables of the standard have their smallest change


@dataclass(frozen=True, slots=True)
class Lamp:
    """F(s) = k w1 s / (s^2 + 2 l s + w1^2) * (1 + s / w2) / ((1 + s / w3) (1 + s / w4))."""

    k: float
    damping: float
    """l / 2 pi [Hz], like the others."""
    f1: float
    f2: float
    f3: float
    f4: float
    change: float
    """Relative voltage change, sinusoidal at 8.8 Hz, that half of all people perceive: Pinst = 1."""

    def weighting(self, rate: float) -> list[Section]:
        """F at `rate` [1/s]."""
        w1, w2, w3, w4 = (2 * math.pi * f for f in (self.f1, self.f2, self.f3, self.f4))
        return [
            bilinear([self.k * w1, 0.0], [1.0, 4 * math.pi * self.damping, w1 * w1], rate),
            bilinear([1 / w2, 1.0], [1 / (w3 * w4), 1 / w3 + 1 / w4, 1.0], rate),
        ]

    def response(self, f: float) -> complex:
        """F at `f` [Hz]."""
        s = 2j * math.pi * f
        w1, w2, w3, w4 = (2 * math.pi * each for each in (self.f1, self.f2, self.f3, self.f4))
        first = self.k * w1 * s / (s * s + 4 * math.pi * self.damping * s + w1 * w1)
        return first * (1 + s / w2) / ((1 + s / w3) * (1 + s / w4))


LAMPS: dict[LampName, Lamp] = {
    "230V": Lamp(1.74802, 4.05981, 9.15494, 2.27979, 1.22535, 21.9, 0.00250),
    "120V": Lamp(1.6357, 4.167375, 9.077169, 2.939902, 1.394468, 17.31512, 0.00321),
}
"""Incandescent lamps of 60 W; the constants of IEC 61000-4-15 for 230 V and 120 V."""


def cut_off(f_nominal: float) -> float:
    """Hz: above it the demodulated voltage is carrier, not flicker."""
    return 42.0 if f_nominal > 55 else 35.0


def demodulation(lamp: Lamp, f_nominal: float, rate: float) -> list[Section]:
    """From the squared voltage to the weighted fluctuation (block 3)."""
    high = bilinear([1.0, 0.0], [1.0, 2 * math.pi * HIGH_PASS], rate)
    return [high, *butterworth(6, cut_off(f_nominal), rate), *lamp.weighting(rate)]


def perception(rate: float) -> Section:
    """Smoothing of the squared fluctuation (block 4)."""
    return bilinear([1.0], [SMOOTHING, 1.0], rate)


def calibration(lamp: Lamp, f_nominal: float) -> float:
    """Factor that makes the largest Pinst 1 for the lamp's change at 8.8 Hz."""
    f = _CALIBRATION
    low = 1 / math.sqrt(1 + (f / cut_off(f_nominal)) ** 12)
    high = 1 / math.sqrt(1 + (HIGH_PASS / f) ** 2)
    amplitude = lamp.change * low * high * abs(lamp.response(f))
    ripple = 1 / math.sqrt(1 + (2 * math.pi * 2 * f * SMOOTHING) ** 2)
    return 2 / (amplitude**2 * (1 + ripple))
