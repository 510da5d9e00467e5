"""Whether a meter averages over more than its rows, by the noise of the power from row to row.

A mean over the time T removes what swings with 1/T, the noise of sensor and mains as well as the motion; only the
rounding of the rows comes later. A supply that lags smooths the motion and leaves the meter's noise white. The two
spectra are compared by Whittle's likelihood (P. Whittle, Arkiv for Matematik 2, 1953), above the frequencies up to
which the motion explains the power.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import nnls

from acqd.arrays import Floats
from acqd.dataset.power import PowerStream
from acqd.dataset.regressors import BAND_HZ
from acqd.numerics import runs_of_true
from acqd.robot.resolution import resolution

_ROWS = 64
"""Rows of each periodogram."""
_POWERS = (0.0, 2.0, 4.0, 8.0, 16.0, 32.0)
"""Of 1/f: white noise, and what is left of the motion."""
_PASSES = 12


def averages_noise(power: PowerStream, spans_s: list[tuple[float, float]], longest_s: float) -> bool:
    """Whether the noise within some spans (begin and end in s) is that of a mean over two rows to `longest_s`."""
    step_s = power.window_ns * 1e-9
    frequency = np.arange(1, _ROWS // 2 + 1) / (_ROWS * step_s)
    above = frequency > BAND_HZ
    spectrum = _spectrum(power, spans_s)
    if spectrum is None or longest_s <= 2 * step_s or above.sum() < 2 * len(_POWERS):
        return False
    f, seen = frequency[above], spectrum[above]
    shapes = (f[:, None] / f[0]) ** -np.array(_POWERS)
    rounding = resolution(np.asarray(power.P[: _ROWS**2])) ** 2 / 12
    behind_supply = _misfit(seen, shapes, rounding)
    tried_s = np.geomspace(2 * step_s, longest_s, _ROWS // 2)
    return any(_misfit(seen, shapes * _of_mean(f, each)[:, None], rounding) < behind_supply for each in tried_s)


def _of_mean(frequency: Floats, average_s: float) -> Floats:
    """Share of the spectrum that a mean leaves at even frequencies [Hz], as the main lobe of Hann's taper sees it."""
    apart = float(frequency[1] - frequency[0])
    weights = {-apart: 1 / 6, 0.0: 2 / 3, apart: 1 / 6}
    return np.asarray(sum(w * np.sinc((frequency + off) * average_s) ** 2 for off, w in weights.items()))


def _spectrum(power: PowerStream, spans_s: list[tuple[float, float]]) -> Floats | None:
    """[_ROWS / 2] W^2 mean periodogram of rows without gaps, but for the mean; None with fewer than their shapes."""
    taper = np.hanning(_ROWS)
    taper /= np.sqrt((taper**2).sum())
    total, count = np.zeros(_ROWS // 2), 0
    for begin_s, end_s in spans_s:
        rows = power.part(round(1e9 * begin_s), round(1e9 * end_s))
        P, time = np.asarray(power.P[rows]), np.asarray(power.time_ns[rows])
        known = np.isfinite(P)
        goes_on = (np.rint(np.diff(time) / power.window_ns) == 1) & known[1:] & known[:-1]
        for first, last in runs_of_true(goes_on):
            for start in range(first, last + 2 - _ROWS, _ROWS // 2):
                piece = P[start : start + _ROWS]
                total += np.abs(np.fft.rfft(taper * (piece - piece.mean()))[1:]) ** 2
                count += 1
    return total / count if count >= len(_POWERS) else None


def _misfit(seen: Floats, shapes: Floats, rounding: float) -> float:
    """-log likelihood of a periodogram for the best sum of spectra `shapes` [frequencies, k] and the rounding's."""
    least = 1e-3 * float(seen.min()) + 1e-12
    expected = np.maximum(seen, least)
    for _ in range(_PASSES):  # least squares with the weights of the last pass: Fisher's scoring
        weights, _ = nnls(shapes / expected[:, None], (seen - rounding) / expected)
        expected = np.maximum(shapes @ weights + rounding, least)
    return float((np.log(expected) + seen / expected).sum())
