"""Accepted effects, and what a selection has found."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Literal

from acqd.discrepancy.joints.witness import Witness
from acqd.discrepancy.regression.design_matrix import Design
from acqd.discrepancy.regression.gram import Column, Regression
from acqd.discrepancy.regression.onset import Gate
from acqd.discrepancy.selection.ranking import Finding

if TYPE_CHECKING:
    from acqd.discrepancy.selection.hypotheses import Hypothesis
from acqd.models.effects.places import Place

Verdict = Literal["effects_found", "nothing_left", "unknown_structure", "not_identifiable"]


@dataclass(frozen=True, slots=True)
class Named:
    """An accepted effect."""

    finding: Finding
    gate: Gate
    place: Place
    """With indices into the columns of `Effect.at`, for the bundle."""
    shape: dict[str, float]
    alternatives: list[Finding]
    """The best findings of other effects and of unnamed alternatives, given the effects before."""
    witness: Witness | None = None
    """Logged torques, given the effects before."""
    doubt: Unknown | None = None
    """An unnamed alternative that explains more, as long as later effects do not explain the difference."""
    ranking: list[Finding] = field(default_factory=list)
    """In which the effect was selected."""
    hypotheses: list[Hypothesis] = field(default_factory=list)
    """Of that ranking."""

    @property
    def id(self) -> str:
        """Of the effect."""
        return self.finding.candidate.id

    @property
    def key(self) -> str:
        """Identity of the hypothesis; owner of its columns in a regression."""
        return self.finding.candidate.key

    def columns(self) -> list[Column]:
        """Columns of the effect for a regression: one per parameter."""
        return [Column(int(place), self.gate.open, owner=self.key) for place in self.finding.candidate.places]


@dataclass(frozen=True, slots=True)
class Unknown:
    """An unnamed alternative that explains more than every effect."""

    finding: Finding
    gate: Gate


@dataclass(slots=True)
class Tracing:
    """Result of a selection."""

    design: Design
    """With the columns of the accepted effects."""
    regression: Regression
    """The base model and all accepted effects."""
    witness: Witness | None = None
    """Logged torques before any effect."""
    verdict: Verdict = "nothing_left"
    effects: list[Named] = field(default_factory=list)
    unknown: Unknown | None = None
    hypotheses: list[Hypothesis] = field(default_factory=list)
    """Of the last ranking."""
    last_ranking: list[Finding] = field(default_factory=list)
    """The last ranking, in which no candidate was credible."""
