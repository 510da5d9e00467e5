"""Savings as a headline, a table and JSON."""

from __future__ import annotations

from typing import Any

from acqd.report.digits import duration, number, percent, quantity, with_error
from acqd.saving.proposals import Proposal, Savings

HEADER = ["what would be different", "cycle", "energy", "saving", "90 % interval", "verdict"]


def headline(found: Savings) -> str:
    """What is worth doing, in a sentence."""
    cycle = f"a cycle of {duration(found.before.seconds)} uses {joules(found.before.energy)}"
    best = found.best
    if best is None:
        return f"No change of timing saves energy beyond the model's error: {cycle}"
    kind = "at equal cycle time" if best in found.equal else f"at a cycle of {duration(best.use.seconds)}"
    return f"{share(best, found)} less {kind}: {cycle}"


def joules(energy: float) -> str:
    """Energy of a cycle."""
    return quantity(energy, "J", 4)


def share(proposal: Proposal, found: Savings) -> str:
    """A saving as a share of what the cycle uses now."""
    return percent(proposal.saving / found.before.energy)


def table(found: Savings) -> tuple[list[str], list[list[str]]]:
    """A header, and a row per proposal."""
    rows = [["as it is", duration(found.before.seconds), joules(found.before.energy), "", "", ""]]
    return HEADER, [*rows, *(_row(each, found) for each in [*found.equal, *found.longer])]


def _row(proposal: Proposal, found: Savings) -> list[str]:
    half, saving = proposal.half, proposal.saving
    interval = "-"
    if half is not None:
        interval = f"{with_error(saving - half, half)} to {with_error(saving + half, half)} J"
    shown = f"{number(saving)} J, {share(proposal, found)}"
    return [
        proposal.name,
        duration(proposal.use.seconds),
        joules(proposal.use.energy),
        shown,
        interval,
        proposal.verdict,
    ]


def as_json(found: Savings) -> dict[str, Any]:
    """For save.json and `--json`."""
    return {
        "model": str(found.subject.model_path), "work": str(found.subject.path),
        "robot": found.subject.arm.description.name, "simulated_power": found.subject.simulated,
        "before": {"seconds": found.before.seconds, "energy_J": found.before.energy},
        "equal": [_proposal(each) for each in found.equal],
        "longer": [_proposal(each) for each in found.longer],
        "not_proposed": [{"name": each.name, "reason": each.reason} for each in found.refused],
        "cannot_tell": found.unknown,
        "outside_of_training": found.subject.beyond,
        "pareto": {
            "seconds": found.pareto.seconds, "best_J": found.pareto.best,
            "uniform_J": [None if value != value else value for value in found.pareto.uniform],
        },
    }  # fmt: skip


def _proposal(each: Proposal) -> dict[str, Any]:
    half = each.half
    return {
        "name": each.name, "seconds": each.use.seconds, "energy_J": each.use.energy, "saving_J": each.saving,
        "interval_J": None if half is None else [each.saving - half, each.saving + half], "verdict": each.verdict,
    }  # fmt: skip
