"""Power factor and the effective values of a polyphase system.

Of single numbers: a live batch is one window, and an array of three numbers costs as much as thirty sums.
"""

from __future__ import annotations

import math
from collections.abc import Sequence


def power_factor(P: float, S: float) -> float:
    """P / S, signed as P; NaN where there is no apparent power."""
    return P / S if S > 0 else math.nan


def effective(phases: Sequence[float]) -> float:
    """Effective voltage or current of a system: sqrt(mean of squares) over the phases.

    IEEE 1459-2010, section 3.2.2.8, neutral terms left out.
    """
    return math.sqrt(sum([value * value for value in phases]) / len(phases))
