"""Power of another time than the motion: a lag that was given wrongly. No cause can be judged from such recordings."""

from __future__ import annotations

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft

from acqd.arrays import Floats
from acqd.discrepancy.delay import agreed
from acqd.discrepancy.recordings import Subject
from acqd.discrepancy.remarks import MOST
from acqd.discrepancy.thresholds import THRESHOLDS
from acqd.models.metrics import predictions


def another_time(subject: Subject) -> str:
    """Why no cause can be judged; empty without a delay, or where the delay is corrected.

    At another time the prediction has to explain most of what remains, and in all recordings at about the same: a load
    that follows the motion leaves most as it is.
    """
    asked, step_s = [*subject.fit, *subject.held_out], subject.data.step_s
    pairs = zip(predictions(subject.model, asked), asked, strict=True)
    found = [
        _delay(predicted, segment.P, step_s)
        for predicted, segment in pairs
        if predicted.std() > THRESHOLDS.delay_least_moving_W
    ]
    if len(found) < THRESHOLDS.few_recordings:
        return ""
    delays, gains = np.array(found).T
    late_s = float(np.median(delays))
    if abs(late_s) <= THRESHOLDS.delay_reach_s or np.median(gains) < MOST or not agreed(delays):
        return ""
    return (
        f"the power comes {abs(late_s):.2f} s {'after' if late_s > 0 else 'before'} the motion that causes it: "
        "acqd dataset build aligns both without --lag"
    )


def _delay(predicted: Floats, P: Floats, step_s: float) -> tuple[float, float]:
    """s that P [T] W is later than `predicted` [T] W, up to half of the recording, and the share that it explains.

    Of the variance of the residual; covariances by fast Fourier transforms.
    """
    a, b = P - P.mean(), predicted - predicted.mean()
    size, reach = next_fast_len(2 * len(a)), len(a) // 2
    products = irfft(rfft(a, size) * rfft(b, size).conj(), size)
    covariance = np.concatenate([products[-reach:], products[: reach + 1]]) / len(a)
    left = a.var() + b.var() - 2 * covariance
    best = int(left.argmin())
    return (best - reach) * step_s, 1 - float(left[best]) / max(float(left[reach]), 1e-12)
