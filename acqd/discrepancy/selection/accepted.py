"""Hypotheses with their status, selected effects, and what a selection has found: frozen records."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

from acqd.arrays import Floats
from acqd.discrepancy.joints.witness import Witness
from acqd.discrepancy.regression.design_matrix import Design
from acqd.discrepancy.regression.least_squares import Column, Regression
from acqd.discrepancy.regression.onset import Gate
from acqd.discrepancy.selection.ranking import Finding, Rows
from acqd.discrepancy.selection.standing import Standing
from acqd.models.effects import library
from acqd.models.effects.laws.law import Law
from acqd.models.effects.places import Place

Verdict = Literal["effects_found", "nothing_left", "unknown_structure", "not_identifiable"]
Status = Literal["leads", "candidate", "refused"]
"""Leads and passes all rules; passes by itself, behind the leader; fails a rule."""


def unnamed(quantity: str) -> str:
    """An unnamed alternative in words: a quantity that the residual follows, or a law of a torque."""
    return quantity if quantity.startswith("a ") else f"something that follows {quantity}"


@dataclass(frozen=True, slots=True, eq=False)
class Hypothesis:
    """A row of the table from which a verdict follows."""

    finding: Finding
    margin: float
    """Evidence that the hypothesis must exceed: chance, and what the columns of earlier effects get wrong."""
    beyond_sessions: float
    """-2 log of the probability among unchanged sessions; infinite where that was not asked."""
    rms_W: float
    """While the effect acts."""
    least_W: float
    """A smaller RMS does not matter."""
    status: Status
    missing: tuple[str, ...] = ()
    """What would change the verdict, in words; empty for the leader and its family."""

    @property
    def id(self) -> str:
        """Of the effect; "" for an unnamed alternative."""
        return self.finding.candidate.id

    @property
    def where(self) -> str:
        """Place, or the quantity that an unnamed alternative depends on."""
        return self.finding.candidate.label

    @property
    def name(self) -> str:
        """Id of the effect, or an unnamed alternative in words."""
        return self.id or unnamed(self.where)

    @property
    def passes(self) -> bool:
        """Whether the hypothesis by itself shows that something is there."""
        return self.status != "refused"

    @property
    def experiment(self) -> str:
        """The recording that would decide."""
        return library()[self.id].experiment if self.id else Law.experiment

    @property
    def parameters(self) -> dict[str, tuple[float, str]]:
        """Value and unit by name; empty for an unnamed alternative."""
        variant = self.finding.candidate.variant
        if not self.id or variant is None:
            return {}
        pairs = zip(variant.place.parameters, self.finding.coefficients, strict=True)
        return {parameter.name: (float(value), parameter.unit) for parameter, value in pairs}

    def as_json(self) -> dict[str, object]:
        """For report.json."""
        beyond = float(self.beyond_sessions)
        return {
            "id": self.id or None,
            "where": self.where,
            "status": self.status,
            "parameters": {name: {"value": value, "unit": unit} for name, (value, unit) in self.parameters.items()},
            "evidence": float(self.finding.evidence),
            "least_evidence": float(self.margin),
            "beyond_sessions": None if beyond == float("inf") else beyond,
            "rms_W": self.rms_W,
            "missing": list(self.missing),
            "experiment": self.experiment,
        }

    def as_text(self) -> str:
        """A sentence for the report."""
        sizes = ", ".join(f"{value:.3g} {unit}" for value, unit in self.parameters.values())
        lacks = f"; missing: {'; '.join(self.missing)}" if self.missing else ""
        place = f" {self.where}" if self.id else ""
        size = f" ({sizes})" if sizes else ""
        return f"{self.name}{place}{size}: evidence {self.finding.evidence:.0f}{lacks}"


@dataclass(frozen=True, slots=True, eq=False)
class Selected:
    """A selected effect."""

    finding: Finding
    gate: Gate
    place: Place
    """With indices into the columns of `Effect.at`, for the bundle."""
    shape: dict[str, float]
    hypothesis: Hypothesis
    """The effect's row of the table in which it leads."""
    witness: Witness | None
    """Logged torques, given the effects before."""
    table: tuple[Hypothesis, ...]
    """In which the effect leads, the largest evidence first."""
    disagreeing: tuple[str, ...] = ()
    """Logs that ask for other parameters of the effect, the clearest first."""

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
        return [Column(int(index), self.gate.open, owner=self.key) for index in self.finding.candidate.indices]


@dataclass(frozen=True, slots=True, eq=False)
class Unknown:
    """An unnamed alternative that explains more than every effect."""

    finding: Finding
    gate: Gate
    margin: float


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Found:
    """What a search has found."""

    effects: tuple[Selected, ...] = ()
    unknown: Unknown | None = None
    steps: tuple[tuple[Hypothesis, ...], ...] = ()
    """Tables of the steps of the search, but for the last one."""
    table: tuple[Hypothesis, ...] = ()
    """Of the step that ended the search."""
    usual: tuple[Hypothesis, ...] = ()
    """What unchanged sessions differ by, too: random effects of the logs in question."""
    standing: Standing | None = None
    """Of every kind of hypothesis before the first effect was selected; None where nothing acts."""

    @property
    def tables(self) -> list[tuple[Hypothesis, ...]]:
        """Of every step of the search."""
        return [*self.steps, self.table]

    @property
    def verdict(self) -> Verdict:
        """Of the search alone."""
        if self.effects:
            return "effects_found"
        return "unknown_structure" if self.unknown is not None else "nothing_left"


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Selection(Found):
    """What a search has found, and the rows that show it: in an hour of recordings, hundreds of MB."""

    rows: Rows
    """With the columns of the selected effects, and the regression of the base model and all of them."""
    witness: Witness | None
    """Logged torques before any effect."""

    @property
    def design(self) -> Design:
        """With the columns of the selected effects."""
        return self.rows.design

    @property
    def regression(self) -> Regression:
        """The base model and all selected effects."""
        return self.rows.regression

    @property
    def found(self) -> Found:
        """Without the rows."""
        return Found(
            effects=self.effects, unknown=self.unknown, steps=self.steps, table=self.table, usual=self.usual,
            standing=self.standing,
        )  # fmt: skip

    @property
    def unexplained(self) -> Rows:
        """Rows of the base model alone, in which the selected effects compete again."""
        regression = self.regression
        for each in self.effects:
            regression = regression.without(each.key)
        return replace(self.rows, design=replace(self.rows.design, witness=self.witness), regression=regression)


def power_in_question(design: Design, finding: Finding, gate: Floats) -> list[Floats]:
    """[rows] W of a finding per block of a gate [blocks]."""
    weights = finding.candidate.weights(finding.coefficients)
    return [
        design.values(part.segment, finding.candidate.indices, part.rows) @ weights
        for part, open_ in zip(design.parts, gate, strict=True)
        if open_
    ]
