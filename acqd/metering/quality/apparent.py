"""Apparent powers of three phases, which differ where the system is unbalanced or distorted (IEEE 1459-2010)."""

from __future__ import annotations

import numpy as np

from acqd.arrays import Floats


def effective_apparent(V: Floats, V_line: Floats, I: Floats, I_n: float) -> float:  # noqa: E741
    """Effective apparent power Se = 3 Ve Ie [VA] of a four-wire system, IEEE 1459-2010, section 3.2.2.8.

    Ve^2 = (3 (Va^2 + Vb^2 + Vc^2) + Vab^2 + Vbc^2 + Vca^2) / 18, Ie^2 = (Ia^2 + Ib^2 + Ic^2 + In^2) / 3 with the
    resistance of the neutral taken as that of a line (rho = 1). `V`, `V_line`, `I` [3] in V, V, A; `I_n` in A.
    """
    Ve = np.sqrt((3 * np.square(V).sum() + np.square(V_line).sum()) / 18)
    Ie = np.sqrt((np.square(I).sum() + I_n**2) / 3)
    return float(3 * Ve * Ie)


def arithmetic_apparent(V: Floats, I: Floats) -> float:  # noqa: E741
    """Arithmetic apparent power SA = sum of V I over the phases [VA], IEEE 1459-2010, section 3.2.2."""
    return float((V * I).sum())
