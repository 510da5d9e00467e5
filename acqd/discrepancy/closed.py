"""The closed loop as a record: everything that the report shows."""

from __future__ import annotations

from dataclasses import dataclass, field

from acqd.arrays import Floats
from acqd.discrepancy.ability.ability import Ability
from acqd.discrepancy.joints.summary import JointLevel
from acqd.discrepancy.recordings import Subject
from acqd.discrepancy.repair.correction import Correction
from acqd.discrepancy.repair.guard import Improved
from acqd.discrepancy.repair.terms import Reported
from acqd.discrepancy.selection.accepted import Found, Hypothesis, Verdict
from acqd.discrepancy.strength import Strength
from acqd.residual.quality import Quality
from acqd.threshold import Stage


@dataclass(frozen=True, slots=True)
class Closed:
    """Everything that the report shows."""

    subject: Subject
    selection: Found
    strengths: dict[str, Strength]
    """By the key of a selected effect."""
    improved: Improved
    before: Quality
    after: Quality
    errors_before: list[Floats]
    """[T] W on the held-out segments."""
    floor_W: float
    floor_source: str
    """Where the noise floor was measured."""
    reference_rmse: float | None
    """W: error of the same model on the reference recordings."""
    joints: JointLevel | None
    verdict: Verdict
    ability: Ability
    """What these recordings could tell."""
    mistimed: bool
    """Whether power and motion are of different times, so that no cause has a name."""
    stages: frozenset[Stage]
    """Stages that ran."""
    notes: list[str]
    warnings: list[str] = field(default_factory=list)
    """Those of the notes that make the verdict less than it seems."""
    largely_unexplained: bool = False
    """Whether the names explain less than half of what the error has grown by."""
    still_grown: bool = False
    """Whether the error after the search is above that of the reference, beyond what the reference explains."""

    @property
    def kept(self) -> list[Reported]:
        """Effects that were added."""
        return self.improved.kept

    @property
    def correction(self) -> Correction | None:
        """Of an unknown structure."""
        return self.improved.correction

    @property
    def extended(self) -> bool:
        """Whether the model after differs from the model before."""
        return self.improved.extended

    @property
    def named(self) -> list[Reported]:
        """Effects that were found: added, or reported only."""
        return self.improved.named

    @property
    def hypotheses(self) -> list[Hypothesis]:
        """Rows of the tables that are no finding: effects without a name, the last step, what sessions differ by."""
        selected = {(each.id, each.finding.candidate.label) for each in self.selection.effects}
        rest = [row for row in self.selection.table if (row.id, row.where) not in selected]
        return [*self.improved.hypotheses, *rest, *self.selection.usual]

    @property
    def errors_after(self) -> list[Floats]:
        """[T] W on the held-out segments."""
        return self.improved.errors
