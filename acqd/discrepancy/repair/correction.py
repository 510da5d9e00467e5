"""The correction of an unknown structure: a law without a name as a term of the model.

A correction predicts, and says nothing about the cause.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from acqd.arrays import Floats
from acqd.discrepancy.regression.torque_alternatives import LawColumns
from acqd.models.augmented import Term
from acqd.models.effects.laws.law import Quantity
from acqd.models.effects.laws.torque_laws import AngleTorque

SIZE = "size"
"""Name of a correction's parameter."""
_SPRING_SHARE = 0.8
"""Share of a torque's variance along the angle that a straight line explains, at least."""


@dataclass(frozen=True, slots=True)
class Correction:
    """A law without a name in the model, and what it looks like."""

    term: Term
    part: LawColumns
    follows: str
    """In words: "a torque that depends on the angle of joint 3"."""
    along: Quantity
    """The quantity that the law depends on most, at substeps of the recordings in question."""
    strength: Floats
    """[N] Nm (or N, or W) of the law there, in true units."""
    recordings: int
    """Number of recordings in which the law acts."""
    begins: str | None
    """First recording with the law; None: all recordings have it."""
    gain: float
    """W RMS by which the correction reduces the held-out error."""

    @property
    def unit(self) -> str:
        """Of the strength."""
        return str(self.size["unit"])

    @property
    def size(self) -> dict[str, Any]:
        """The strength that 95 % of the rows with the law stay below, with its interval."""
        return dict(self.term.parameters[SIZE])

    @property
    def looks_like(self) -> str:
        """ "a spring of 12 Nm/rad" for a torque that grows in proportion to the angle; "" for everything else."""
        angle, torque = self.along.values, self.strength
        if not isinstance(self.part.law, AngleTorque) or angle.std() <= 0.01 * max(float(np.abs(angle).max()), 1.0):
            return ""
        slope, _ = np.polyfit(angle, torque, 1)
        share = np.corrcoef(angle, torque)[0, 1] ** 2
        if slope <= 0 or share < _SPRING_SHARE:
            return ""
        return f"a spring of {slope:.2g} {self.unit}/{self.along.unit}"

    def as_json(self) -> dict[str, Any]:
        """For report.json."""
        return {
            "follows": self.follows, "id": self.term.id, "where": self.term.where, "equation": self.part.law.equation,
            "size": self.size, "looks_like": self.looks_like or None, "begins": self.begins, "delta_rmse": self.gain,
        }  # fmt: skip
