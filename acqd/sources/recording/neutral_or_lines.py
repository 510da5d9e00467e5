"""Are three voltages called A, B, C those to neutral, or those between lines? What a recording itself can tell.

Three voltages between lines close a loop: their sum is zero at every frequency (Kirchhoff). Voltages to neutral have a
sum wherever a network has a zero sequence, and nearly all have one at three times the frequency of the mains. So a sum
is a proof; its absence proves nothing, and the size and the angles to the currents are left to be shown.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats
from acqd.metering.block import Codes
from acqd.metering.wiring_check import LEADING_deg

_CYCLES = 10
"""Of one look: the window of IEC 61000-4-30."""
_LOOKS = 8
"""Over the recording; the one with the largest currents is taken."""
_SAMPLES = 128
"""A cycle at most: enough for the third harmonic."""
_SEARCH = (0.8, 1.3)
"""Where the mains are, in nominal frequencies: 60 Hz may be metered as 50 Hz."""
_CLOSED = 0.02
"""RMS of the sum, as a share of the voltages: two transformers at the ends of class 1 leave less."""
_THIRD = 0.005
"""The same at three times the frequency. Transformers and converters of class 1 make less of it by themselves."""
_ALIKE = 0.06
"""Spread of the three voltages: of a network without a fault (EN 50160 allows 2 % unbalance; transformers add)."""
_LOADED = 1e-3
"""Fundamental of a current, as a share of its RMS: below it, there is no angle to show."""


@dataclass(frozen=True, slots=True)
class Reading:
    """What the load takes if the voltages are those to neutral (or between lines)."""

    P_W: float
    lag_deg: float
    """By which the current lags the voltage, of the three phases together."""

    @property
    def ordinary(self) -> bool:
        """Whether a load draws power so: it neither feeds back nor leads as only capacitors do."""
        return self.P_W > 0 and self.lag_deg > LEADING_deg


@dataclass(frozen=True, slots=True)
class Compared:
    """Three voltages, of which nothing proves that they are to neutral."""

    size_V: float
    to_neutral: Reading | None
    """None: no load."""
    between_lines: Reading | None

    def words(self) -> str:
        """Both readings, and which of them is ordinary where one is."""
        if self.to_neutral is None or self.between_lines is None:
            return "no load shows which"
        text = f"to neutral {_words(self.to_neutral)}, between lines {_words(self.between_lines)}"
        if self.to_neutral.ordinary == self.between_lines.ordinary:
            return text
        return f"{text}; the angles speak for {'neutral' if self.to_neutral.ordinary else 'lines'}"


def _words(one: Reading) -> str:
    return f"{one.P_W:.4g} W with I {abs(one.lag_deg):.0f} degrees {'behind' if one.lag_deg >= 0 else 'before'} U"


def compare(codes: Codes, scale: NDArray[np.float64], rate: float, f_nominal: float) -> Compared | None:
    """Of u, i, u, i, u, i [samples, 6] at `rate` [1/s]; None where the sum proves voltages to neutral.

    None also where the three differ as those of a healthy network do not: the check of the wiring has them.
    """
    step = max(1, math.floor(rate / (_SAMPLES * f_nominal)))
    length = min(len(codes), round(_CYCLES * rate / f_nominal))
    starts = np.unique(np.linspace(0, len(codes) - length, _LOOKS).astype(int))
    looks = [codes[at : at + length : step].astype(np.float64) * scale for at in starts]
    values = max(looks, key=lambda one: float((one[:, 1::2] ** 2).sum()))
    u = values[:, 0::2]
    rms = np.sqrt((u * u).mean(axis=0))
    size = float(rms.mean())
    if not size or np.sqrt((u.sum(axis=1) ** 2).mean()) > _CLOSED * size or np.ptp(rms) > _ALIKE * size:
        return None
    window = np.hanning(len(values))[:, None]
    lines = np.fft.rfft((values - values.mean(axis=0)) * window, axis=0) * np.sqrt(2) / window.sum()
    f = np.fft.rfftfreq(len(values), step / rate)
    near = np.flatnonzero((f >= _SEARCH[0] * f_nominal) & (f <= _SEARCH[1] * f_nominal))
    if not len(near):
        return Compared(size, None, None)
    mains = int(near[np.argmax(np.abs(lines[near, 0]))])
    third = np.abs(lines[3 * mains - 2 : 3 * mains + 3, 0::2].sum(axis=1)) if mains > 2 else np.zeros(0)
    if third.size and third.max() > _THIRD * size:
        return None
    volts, amperes = lines[mains, 0::2], lines[mains, 1::2]
    if np.abs(amperes).max() <= _LOADED * np.sqrt((values[:, 1::2] ** 2).mean(axis=0)).max():
        return Compared(size, None, None)
    i = values[:, 1::2]
    return Compared(size, _reading(u, i, volts, amperes), _reading(_star(u), i, _star(volts), amperes))


def _star(lines: NDArray[Any]) -> NDArray[Any]:
    """Star voltages of U12, U23, U31 [..., 3]: U1 = (U12 - U31) / 3."""
    return np.asarray((lines - np.roll(lines, 1, axis=-1)) / 3)


def _reading(u: Floats, i: Floats, volts: NDArray[Any], amperes: NDArray[Any]) -> Reading:
    """P of samples [samples, 3], the angle of their fundamentals [3]."""
    angle = complex((volts * amperes.conj()).sum())
    return Reading(float((u * i).sum(axis=1).mean()), math.degrees(math.atan2(angle.imag, angle.real)))
