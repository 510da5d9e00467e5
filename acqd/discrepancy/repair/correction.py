"""The correction of an unknown structure: a law without a name as a term of the model.

A correction predicts, and says nothing about the cause.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from acqd.arrays import Floats
from acqd.discrepancy.regression.torque_alternatives import LawColumns
from acqd.models.augmented import Term
from acqd.models.effects.laws.law import Quantity

SIZE = "size"
"""Name of a correction's parameter."""


@dataclass(frozen=True, slots=True)
class Correction:
    """A law without a name in the model, and what it looks like."""

    term: Term
    law: LawColumns
    follows: str
    """In words: "a torque that depends on the angle of joint 3"."""
    along: Quantity
    """The quantity that the law depends on most, at substeps of the recordings in question."""
    strength: Floats
    """[N] Nm (or N, or W) of the law there, in true units."""
    looks_like: str
    """"a spring of 12 Nm/rad"; "" if the law looks like nothing simple."""
    gain: float
    """W RMS by which the correction reduces the held-out error."""

    @property
    def unit(self) -> str:
        """Of the strength."""
        return str(self.size["unit"])

    @property
    def size(self) -> dict[str, Any]:
        """The strength that 95 % of the rows stay below, with its interval."""
        return dict(self.term.parameters[SIZE])

    def as_json(self) -> dict[str, Any]:
        """For report.json."""
        return {
            "follows": self.follows, "id": self.term.id, "where": self.term.where, "equation": self.law.law.equation,
            "size": self.size, "looks_like": self.looks_like or None, "delta_rmse": self.gain, "added": True,
        }  # fmt: skip
