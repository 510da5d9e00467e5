"""Savings as a headline, a table and JSON."""

from __future__ import annotations

from typing import Any

from acqd.report.digits import duration, number, percent, quantity, with_error
from acqd.saving.proposals import Block, Proposal, Savings, WhatIf

HEADER = ["what would be different", "cycle", "energy", "saving", "90 % interval", "verdict"]


def headline(found: Savings) -> str:
    """What is worth doing, in a sentence."""
    cycle = f"a cycle of {duration(found.before.seconds)} uses {joules(found.before.energy)}"
    if found.best is None:
        return f"No change of timing saves energy beyond the model's error: {cycle}"
    block, best = found.best
    known = "" if best.half is not None else " by the model, whose error is unknown"
    share = percent(best.saving / block.instead.use.energy)
    if block is found.equal:
        return f"{share} less at equal cycle time{known}: {cycle}"
    return f"{share} less than {block.instead.name} in {duration(block.seconds)}{known}: {cycle}"


def joules(energy: float) -> str:
    """Energy of a cycle."""
    return quantity(energy, "J", 4)


def table(block: Block) -> list[list[str]]:
    """A row for what the proposals are compared with, and a row per proposal."""
    instead = block.instead
    first = [instead.name, duration(instead.use.seconds), joules(instead.use.energy), "", "", ""]
    return [first, *(_row(each, instead) for each in block.proposals)]


def _row(proposal: Proposal, instead: Proposal) -> list[str]:
    half, saving = proposal.half, proposal.saving
    shown = f"{number(saving)} J, {percent(saving / instead.use.energy)}"
    return [
        proposal.name, duration(proposal.use.seconds), joules(proposal.use.energy), shown,
        _interval(saving, half), proposal.verdict,
    ]  # fmt: skip


def _interval(saving: float, half: float | None) -> str:
    if half is None:
        return "-"
    return f"{with_error(saving - half, half)} to {with_error(saving + half, half)} J"


def what_if_text(each: WhatIf) -> str:
    """A sentence."""
    return f"with {each.name}: {joules(each.energy)}, saving {_interval(each.saving, each.half)}"


def as_json(found: Savings) -> dict[str, Any]:
    """For save.json and `--json`."""
    subject, doubt = found.subject, found.subject.doubt
    return {
        "model": str(subject.model_path), "work": str(subject.path),
        "robot": subject.arm.description.name, "simulated_power": subject.simulated,
        "equal": _block(found.equal), "other": _block(found.other),
        "not_proposed": [{"name": each.name, "reason": each.reason} for each in found.refused],
        "what_if": [
            {"name": each.name, "energy_J": each.energy, "saving_J": each.saving, "half_J": each.half}
            for each in found.what_ifs
        ],
        "cannot_tell": found.unknown,
        "outside_of_training": subject.beyond,
        "held_out": None if doubt is None else {"blocks": doubt.blocks, "recordings": doubt.recordings},
        "pareto": {
            "seconds": found.pareto.seconds, "best_J": found.pareto.best,
            "uniform_J": _known(found.pareto.uniform), "waiting_J": _known(found.pareto.waiting),
        },
    }  # fmt: skip


def _known(values: list[float]) -> list[float | None]:
    return [value if value == value else None for value in values]


def _block(block: Block) -> dict[str, Any]:
    use = block.instead.use
    return {
        "seconds": block.seconds,
        "instead": {"name": block.instead.name, "seconds": use.seconds, "energy_J": use.energy},
        "proposals": [_proposal(each) for each in block.proposals],
    }


def _proposal(each: Proposal) -> dict[str, Any]:
    half = each.half
    return {
        "name": each.name, "seconds": each.use.seconds, "energy_J": each.use.energy, "saving_J": each.saving,
        "interval_J": None if half is None else [each.saving - half, each.saving + half], "verdict": each.verdict,
        "causes_J": {cause.value: energy for cause, energy in each.use.causes.items()},
    }  # fmt: skip
