"""How every hypothesis stands beside all others, before any effect was selected: what a set of causes is made from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from acqd.arrays import Floats
from acqd.discrepancy.thresholds import THRESHOLDS

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
    twin: tuple[str, float] | None = None
    """Id of an effect that would draw the same power, and the probability that it is there instead."""


@dataclass(frozen=True)
class Standing:
    """Evidence of every kind of hypothesis, and what the two strongest leave to the others."""

    evidence: Mapping[str, float]
    """Id of an effect, or LAW -> evidence."""
    moved: Mapping[str, tuple[float, float]]
    """Id or LAW -> evidence that wrong columns could move to or from the leading effect, and the best law."""
    above_nothing: float
    """Evidence of the best hypothesis, or what unchanged sessions leave of it."""
    twins: Mapping[str, tuple[str, float]]
    """Id -> id of an effect that would draw the same power, and the probability that it is there instead."""

    @classmethod
    def of(cls, contenders: Sequence[Contender], above_nothing: float) -> Standing:
        """Columns that are wrong by kappa leave up to kappa^2 rho^2 of what the stronger one explains (ADR 26)."""
        leading = [_strongest([each for each in contenders if (each.id == LAW) == law]) for law in (False, True)]
        moved = {each.id: (_moved(each, leading[0]), _moved(each, leading[1])) for each in contenders}
        twins = {each.id: each.twin for each in contenders if each.twin is not None}
        return cls({each.id: each.evidence for each in contenders}, moved, above_nothing, twins)

    @cached_property
    def _rivals(self) -> tuple[Floats, Floats]:
        """[hypotheses, rivals] evidence that a rival is ahead, -inf for none, and what may be moved between the two."""
        names = list(self.evidence)
        firsts = [_first(self.evidence, law=False), _first(self.evidence, law=True)]
        ahead, moved = np.full((len(names), len(names)), -np.inf), np.zeros((len(names), len(names)))
        for k, name in enumerate(names):
            for j, rival in enumerate(names):
                if name != rival and (name in firsts or rival in firsts):  # the others are behind one of the two
                    ahead[k, j] = self.evidence[rival] - self.evidence[name]
                    moved[k, j] = (
                        self.moved[name][firsts.index(rival)]
                        if rival in firsts
                        else self.moved[rival][firsts.index(name)]
                    )
        return ahead, moved

    def behind(self, chance: float, share: float = 1.0) -> dict[str, float]:
        """Evidence that the strongest rival is ahead, over what chance and wrong columns may move; negative: a lead.

        `chance`: evidence; `share`: of what wrong columns could move at most.
        """
        if len(self.evidence) == 1:
            return {name: -evidence / chance for name, evidence in self.evidence.items()}
        ahead, moved = self._rivals
        found = (ahead / (chance + share * moved)).max(axis=1, initial=-np.inf)
        return dict(zip(self.evidence, found.tolist(), strict=True))

    def as_json(self) -> dict[str, Any]:
        """For report.json."""
        return {
            "evidence": dict(self.evidence), "moved": {name: list(each) for name, each in self.moved.items()},
            "above_nothing": self.above_nothing, "twins": {name: list(each) for name, each in self.twins.items()},
        }  # fmt: skip

    @classmethod
    def from_json(cls, content: Mapping[str, Any]) -> Standing:
        """The inverse of `as_json`."""
        moved = {name: (float(a), float(b)) for name, (a, b) in content["moved"].items()}
        twins = {name: (str(other), float(share)) for name, (other, share) in content["twins"].items()}
        return cls(dict(content["evidence"]), moved, float(content["above_nothing"]), twins)


def proportional(mine: Floats, theirs: Floats) -> float:
    """How far two powers [rows] are proportional, whatever their signs: 1 if they are."""
    scale = float(mine @ mine) * float(theirs @ theirs)
    return float(np.abs(mine) @ np.abs(theirs)) ** 2 / max(scale, 1e-12)


def _strongest(contenders: Sequence[Contender]) -> Contender | None:
    return max(contenders, key=lambda each: each.evidence, default=None)


def _first(evidence: Mapping[str, float], *, law: bool) -> str | None:
    return max((name for name in evidence if (name == LAW) == law), key=lambda name: evidence[name], default=None)


def _moved(one: Contender, other: Contender | None) -> float:
    if other is None or other is one:
        return 0.0
    larger = max(one.evidence, other.evidence, 0.0)
    return THRESHOLDS.column_error**2 * proportional(one.power, other.power) * larger
