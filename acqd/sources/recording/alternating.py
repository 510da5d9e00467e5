"""Does the voltage alternate as mains do? A wrong sampling rate moves f out of the range of all mains."""

from __future__ import annotations

import numpy as np

from acqd.metering.block import NOMINAL, NOMINAL_TEXT, Codes, StreamFormat

_SAMPLES = 1 << 16
"""That are looked at: a spectrum takes a hundred bytes for each."""
_LEAST_S = 0.5
"""Shorter ones show f to no better than some Hz."""
_SLACK_Hz = 2.0
_DEAD_V = 10.0
"""RMS: below it there is no voltage, and what remains is hum."""
_SHARE = 0.7
"""Of the alternating power: the line is a fundamental, and not one of many."""
_DIRECT = 10.0
"""Times the alternating part: a direct voltage."""


def remarks(codes: Codes, form: StreamFormat) -> tuple[str, ...]:
    """What to ask where no voltage is of mains, and the first is clearly of another frequency, or direct."""
    samples = min(len(codes), _SAMPLES)
    if samples < _LEAST_S * form.rate:
        return ()
    found = [_frequency(codes[:samples, k] * abs(form.scale[k]), form.rate) for k in range(0, codes.shape[1], 2)]
    known = [f for f in found if f is not None]
    if not known or any(low - _SLACK_Hz <= f <= high + _SLACK_Hz for f in known for low, high in NOMINAL):
        return ()
    if known[0] == 0:
        return ("its voltage is direct; f and what follows from it are unknown",)
    return (f"its voltage alternates at {known[0]:.3g} Hz, {NOMINAL_TEXT}; is the sampling rate right (--rate)?",)


def _frequency(u: np.ndarray, rate: float) -> float | None:
    """Of the line that carries most of a voltage [V]; 0 for a direct one, None for none and for many lines."""
    mean, size = float(u.mean()), float(u.std())
    if abs(mean) > _DIRECT * size and abs(mean) > _DEAD_V:
        return 0.0
    if size < _DEAD_V or not np.isfinite(size):
        return None
    power = np.abs(np.fft.rfft((u - mean) * np.hanning(len(u)))) ** 2
    at = int(np.argmax(power))
    near = power[max(0, at - 2) : at + 3].sum()
    return float(at * rate / len(u)) if near > _SHARE * power.sum() else None
