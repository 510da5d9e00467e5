"""The way of one effect through the rules: what `acqd close-loop --explain ID` prints."""

from __future__ import annotations

import numpy as np

from acqd.discrepancy.closed import Closed
from acqd.discrepancy.repair.terms import Reported
from acqd.discrepancy.selection.accepted import Hypothesis
from acqd.discrepancy.thresholds import THRESHOLDS
from acqd.report.digits import number, percent


def way_of(closed: Closed, effect_id: str) -> list[str]:
    """One line per step of the selection and per later rule, in their order."""
    lines = []
    for step, table in enumerate(closed.selection.tables, 1):
        row = next((each for each in table if each.id == effect_id), None)
        if row is not None:
            lines.append(f"step {step}: {_row(row, table)}")
        elif table:
            lines.append(f"step {step}: not among the {len(table)} leading hypotheses")
    later = [line for each in closed.improved.effects if each.term.id == effect_id for line in _later(each)]
    return [*lines, *later] or [f"{effect_id}: no evidence in any step"]


def _row(row: Hypothesis, table: tuple[Hypothesis, ...]) -> str:
    sizes = ", ".join(f"{number(value)} {unit}" for value, unit in row.parameters.values())
    evidence = f"evidence {row.finding.evidence:.0f}, margin {row.margin:.0f}"
    sessions = "" if np.isinf(row.beyond_sessions) else f", beyond unchanged sessions {row.beyond_sessions:.0f}"
    size = f"{number(row.rms_W)} W while acting, {number(row.least_W)} W matter"
    place = f"{row.id} ({row.where}; {sizes}): {evidence}{sessions}; {size}"
    if row.status == "leads":
        second = next((each for each in table if each is not row), None)
        return f"{place}; leads{'' if second is None else _ahead_of(second, row)}"
    return f"{place}; missing: {'; '.join(row.missing)}" if row.missing else place


def _ahead_of(second: Hypothesis, leader: Hypothesis) -> str:
    """How far the leader is ahead, or what the one that has more evidence lacks (rule 4)."""
    ahead = leader.finding.evidence - second.finding.evidence
    if ahead >= 0 or not second.missing:
        return f", {ahead:.0f} ahead of {second.name}"
    return f"; {second.name} has {-ahead:.0f} more evidence, and lacks {'; '.join(second.missing)}"


def _later(effect: Reported) -> list[str]:
    lines = []
    if effect.hypothesis is not None:
        kin = ", ".join(name for name, _ in effect.family)
        family = f", {percent(effect.family_confidence)} with {kin}" if kin else ""
        needed = f"{percent(THRESHOLDS.least_confidence)} are needed"
        lines.append(f"confidence {percent(effect.confidence)}{family}; {needed}")
    said = {
        "added": f"held-out recordings: RMSE {number(effect.gain_W)} W lower; added to the model",
        "reported": "held-out recordings: predicted better, RMSE not lower; reported, not added",
        "hypothesis": f"no finding; missing: {effect.missing}",
        "refused": f"no finding; missing: {effect.missing}",
    }
    return lines + ([said[effect.status]] if effect.status in said else [])
