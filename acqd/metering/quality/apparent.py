"""Apparent powers of three phases, which differ where the system is unbalanced or distorted (IEEE 1459-2010).

Of single numbers: an array of three costs as much as thirty sums.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from operator import mul


def effective_apparent(V: Sequence[float], V_line: Sequence[float], I: Sequence[float], I_n: float) -> float:  # noqa: E741
    """Effective apparent power Se = 3 Ve Ie [VA] of a four-wire system, IEEE 1459-2010, section 3.2.2.8.

    Ve^2 = (3 (Va^2 + Vb^2 + Vc^2) + Vab^2 + Vbc^2 + Vca^2) / 18, Ie^2 = (Ia^2 + Ib^2 + Ic^2 + In^2) / 3 with the
    resistance of the neutral taken as that of a line (rho = 1). `V`, `V_line`, `I` [3] in V, V, A; `I_n` in A.
    """
    Ve = math.sqrt((3 * sum(map(mul, V, V)) + sum(map(mul, V_line, V_line))) / 18)
    Ie = math.sqrt((sum(map(mul, I, I)) + I_n * I_n) / 3)
    return 3 * Ve * Ie


def arithmetic_apparent(V: Sequence[float], I: Sequence[float]) -> float:  # noqa: E741
    """Arithmetic apparent power SA = sum of V I over the phases [VA], IEEE 1459-2010, section 3.2.2."""
    return float(sum(map(mul, V, I)))
