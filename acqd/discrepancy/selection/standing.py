"""How every hypothesis stands beside all others, before any effect was selected: what a set of causes is made from.

Differences of evidence are divided by the margin (ADR 26), so that they mean the same for small and for large effects:
a hypothesis that is one margin ahead of another explains more than chance and wrong columns can move between the two.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from acqd.arrays import Floats
from acqd.discrepancy.thresholds import THRESHOLDS
from acqd.discrepancy.thresholds.chance import by_chance

LAW = ""
"""The best law without a name, among ids of effects."""


@dataclass(frozen=True, slots=True)
class Contender:
    """A kind of hypothesis in its best place and shape."""

    id: str
    """Of the effect, or LAW."""
    evidence: float
    power: Floats
    """[white rows] W, of all blocks in question."""


@dataclass(frozen=True, slots=True)
class Standing:
    """Where every kind of hypothesis stands."""

    behind: dict[str, float]
    """Id of an effect, or LAW -> margins that the strongest rival is ahead; negative for the leader."""
    above_nothing: float
    """The best hypothesis against nothing: evidence, or what unchanged sessions leave of it, in margins of chance."""

    @classmethod
    def of(cls, contenders: Sequence[Contender], kinds: int, best: float) -> Standing:
        """`best`: evidence of the best hypothesis beyond chance and beyond what unchanged sessions differ by."""
        chance = by_chance(kinds)
        behind = {
            own.id: max(
                (_ahead(rival, own, chance) for rival in contenders if rival is not own), default=-best / chance
            )
            for own in contenders
        }
        return cls(behind, best / chance)


def _ahead(rival: Contender, own: Contender, chance: float) -> float:
    """Margins between two hypotheses: the larger one leaves to the other what its columns may get wrong."""
    larger = max(rival.evidence, own.evidence, 0.0)
    margin = chance + THRESHOLDS.column_error**2 * proportional(rival.power, own.power) * larger
    return (rival.evidence - own.evidence) / margin


def proportional(mine: Floats, theirs: Floats) -> float:
    """How far two powers [rows] are proportional, whatever their signs: 1 if they are."""
    scale = float(mine @ mine) * float(theirs @ theirs)
    return float(np.abs(mine) @ np.abs(theirs)) ** 2 / max(scale, 1e-12)
