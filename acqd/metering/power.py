"""Power factor and the quantities of a polyphase system."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acqd.arrays import Floats


def power_factor(P: Floats, S: Floats) -> Floats:
    """P / S, signed as P; NaN where there is no apparent power."""
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(np.where(S > 0, P / S, np.nan))


def effective(phases: Floats) -> Floats:
    """Effective voltage or current of a system, sqrt(mean of squares) over the phases (first axis): IEEE 1459-2010."""
    return np.asarray(np.sqrt(np.mean(np.square(phases), axis=0)))


@dataclass(frozen=True, slots=True)
class Total:
    """The polyphase total, [windows] each."""

    Vrms: Floats
    """Effective voltage sqrt(mean Vrms^2) [V] (IEEE 1459-2010, section 3.2.2.8, neutral terms left out)."""
    Irms: Floats
    """Effective current sqrt(mean Irms^2) [A] (same source)."""
    P: Floats
    """Sum of the phases' active powers [W]."""
    S: Floats
    """Arithmetic apparent power: sum of the phases' S [VA]."""


def total(Vrms: Floats, Irms: Floats, P: Floats) -> Total:
    """Total of phases [phases, windows]."""
    return Total(
        Vrms=effective(Vrms),
        Irms=effective(Irms),
        P=P.sum(axis=0),
        S=(Vrms * Irms).sum(axis=0),
    )
