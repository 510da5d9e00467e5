"""Whether the error of the model wanders slowly, as heat, mains or a meter do, rather than with the motion."""

from __future__ import annotations

import numpy as np

from acqd.arrays import Floats
from acqd.discrepancy.closed import Closed
from acqd.report.digits import number, percent
from acqd.residual.residuals import errors_of

_BLOCK_S = 10.0
"""Motion of a robot averages out within this time, heat and meters do not."""
_MOST = 0.5
"""Of the squared error: a larger share in averages over blocks is said to wander."""
_GROWN = 2.0
"""Times the slow error of the reference recordings."""


def slow_part(errors: list[Floats], step_s: float) -> tuple[float, float]:
    """RMS (W) of the averages over 10 s about their common mean, and its share of the squared error about that mean.

    `errors`: [T] W per segment. A segment shorter than a block is left out; (0, 0) if all are.
    """
    rows = max(round(_BLOCK_S / step_s), 1)
    blocks = [error[: len(error) // rows * rows].reshape(-1, rows) for error in errors if len(error) >= rows]
    if not blocks:
        return 0.0, 0.0
    every = np.concatenate(blocks)
    every = every - every.mean()
    slow, whole = float((every.mean(axis=1) ** 2).mean()), float((every**2).mean())
    return slow**0.5, slow / max(whole, 1e-12)


def wandering(closed: Closed) -> str:
    """What to record when most of the error wanders and the reference's error does not; else ""."""
    subject = closed.subject
    slow_W, share = slow_part(closed.errors_before, subject.data.step_s)
    if share < _MOST:
        return ""
    if subject.reference:
        usual_W, _ = slow_part(errors_of(subject.model, subject.reference), subject.data.step_s)
        if slow_W < _GROWN * usual_W:
            return ""
    size = f"{number(slow_W, 2)} W RMS in averages over {_BLOCK_S:.0f} s, {percent(share)} of the squared error"
    return (
        f"the power wanders slowly ({size}), which motion alone does not do: let the robot warm up, log temperatures "
        "and the mains voltage, and record two minutes at rest before and after"
    )
