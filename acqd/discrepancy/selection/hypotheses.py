"""What was considered and not accepted: size, evidence, what is missing, and which recording would decide."""

from __future__ import annotations

from dataclasses import dataclass

from acqd.discrepancy.selection.acceptance import View, least_evidence, missing
from acqd.discrepancy.selection.ranking import Finding
from acqd.models.effects import library
from acqd.models.effects.laws.law import Law

_SHOWN = 6


def unnamed(quantity: str) -> str:
    """An unnamed alternative in words: a quantity that the residual follows, or a law of a torque."""
    return quantity if quantity.startswith("a ") else f"something that follows {quantity}"


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """A finding that stood in the last ranking."""

    id: str
    """Of the effect; "" for an unnamed alternative."""
    where: str
    """Place, or the quantity that an unnamed alternative depends on."""
    parameters: dict[str, tuple[float, str]]
    """Value and unit by name; empty for an unnamed alternative."""
    evidence: float
    least_evidence: float
    missing: list[str]
    """Hurdles that the finding does not pass, in words; empty if another finding was preferred."""

    def as_json(self) -> dict[str, object]:
        """For report.json."""
        return {
            "id": self.id or None,
            "where": self.where,
            "parameters": {name: {"value": value, "unit": unit} for name, (value, unit) in self.parameters.items()},
            "evidence": self.evidence,
            "least_evidence": self.least_evidence,
            "missing": self.missing,
            "experiment": self.experiment,
        }

    @property
    def experiment(self) -> str:
        """The recording that would decide."""
        return library()[self.id].experiment if self.id else Law.experiment

    def as_text(self) -> str:
        """A sentence for the report."""
        name = self.id or unnamed(self.where)
        sizes = ", ".join(f"{value:.3g} {unit}" for value, unit in self.parameters.values())
        lacks = f"; missing: {'; '.join(self.missing)}" if self.missing else ""
        place = f" {self.where}" if self.id else ""
        return f"{name}{place}{f' ({sizes})' if sizes else ''}: evidence {self.evidence:.0f}{lacks}"


def hypotheses(view: View, findings: list[Finding], limit: float) -> list[Hypothesis]:
    """The best finding of every effect and of every unnamed alternative, the largest evidence first."""
    best: dict[str, Finding] = {}
    for finding in findings:
        key = finding.candidate.id or finding.candidate.label
        if key not in best or finding.evidence > best[key].evidence:
            best[key] = finding
    leading = sorted(best.values(), key=lambda finding: -finding.evidence)[:_SHOWN]
    return [_described(view, finding, limit) for finding in leading if finding.evidence > 0]


def _described(view: View, finding: Finding, limit: float) -> Hypothesis:
    candidate = finding.candidate
    parameters = candidate.variant.place.parameters if candidate.variant else ()
    sizes = {p.name: (float(c), p.unit) for p, c in zip(parameters, finding.coefficients, strict=False)}
    if not candidate.id:
        sizes = {}
    return Hypothesis(
        candidate.id, candidate.label, sizes, float(finding.evidence), float(least_evidence(view, finding)),
        missing(view, finding, limit),
    )  # fmt: skip
