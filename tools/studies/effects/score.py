"""Tables of a benchmark: who was named, how sure, how much of the hidden power was recovered."""

from __future__ import annotations

from typing import Any

import numpy as np
from rich.table import Table

from acqd.report.digits import percent
from tools.studies.effects.cases import OUTSIDE_IDS

_UNNAMED = {"torque_bias", "spring", *OUTSIDE_IDS}
"""Effects of the laboratory that the library does not have an id for: unknown, or nothing, is right."""
_CALLED = {"encoder_bias": "joint_zero"}
"""What the library calls effects of the laboratory that have another id there."""


def strength(result: dict[str, Any]) -> str:
    """`0.03`, `clean` or `pair`."""
    if not result["truth"]:
        return "clean"
    return "pair" if len(result["truth"]) > 1 else result["case"].rpartition("-")[2]


def outcome(result: dict[str, Any]) -> str:
    """right, second, wrong, unknown, silent; for pairs both, one, none; for what has no id unknown or wrong."""
    truth = [_CALLED.get(effect["id"], effect["id"]) for effect in result["truth"]]
    report = result["report"]
    named = [effect["id"] for effect in report["effects"]]
    if len(truth) > 1:
        hits = len(set(truth) & set(named))
        return ("none", "one", "both")[hits] + (" + spurious" if set(named) - set(truth) else "")
    if not truth:
        return "false alarm" if named or report["verdict"] == "unknown_structure" else "silent"
    if truth[0] in _UNNAMED:
        if named:
            return "wrong name"
        return "unknown" if report["verdict"] == "unknown_structure" else "silent"
    if named[:1] == truth:
        return "right"
    rivals = [rival["id"] for effect in report["effects"][:1] for rival in effect["rivals"][:1]]
    if truth[0] in named[:2] + rivals:
        return "second"
    if named:
        return "wrong"
    return "unknown" if report["verdict"] == "unknown_structure" else "silent"


def table(results: list[dict[str, Any]]) -> list[Table]:
    """All tables."""
    return [_rates(results), _cases(results)]


def _rates(results: list[dict[str, Any]]) -> Table:
    found = Table(
        "strength", "cases", "outcomes", "RMSE before", "after", "floor", "worse", "seconds (median, max)",
        title="closing the loop, blind (simulated)",
    )  # fmt: skip
    for level in ("clean", "0.01", "0.03", "0.1", "pair"):
        for outside in (False, True):
            own = [
                r for r in results
                if strength(r) == level and (bool(r["truth"]) and r["truth"][0]["id"] in _UNNAMED) == outside
            ]  # fmt: skip
            if not own:
                continue
            outcomes: dict[str, int] = {}
            for result in own:
                outcomes[outcome(result)] = outcomes.get(outcome(result), 0) + 1
            reports = [result["report"] for result in own]
            worse = sum(r["after"]["rmse"] > r["before"]["rmse"] + 1e-9 for r in reports)
            seconds = [result["seconds"] for result in own]
            counted = ", ".join(f"{count} {name}" for name, count in sorted(outcomes.items(), key=lambda x: -x[1]))
            found.add_row(
                level + (" outside" if outside else ""), str(len(own)), counted,
                f"{np.median([r['before']['rmse'] for r in reports]):.2f}",
                f"{np.median([r['after']['rmse'] for r in reports]):.2f}",
                f"{np.median([r['reference_rmse'] or np.nan for r in reports]):.2f}",
                str(worse), f"{np.median(seconds):.0f}, {max(seconds):.0f}",
            )  # fmt: skip
    return found


def _cases(results: list[dict[str, Any]]) -> Table:
    found = Table("case", "outcome", "named (confidence)", "parameters", "truth", "RMSE before -> after (reference)")
    for result in results:
        report = result["report"]
        named = (
            "; ".join(f"{e['id']} {e['where']} {percent(e['confidence'])}" for e in report["effects"])
            or report["verdict"]
        )
        parameters = "; ".join(
            f"{name} {p['value']:.3g}" + (f" [{p['ci95'][0]:.3g}, {p['ci95'][1]:.3g}]" if p["ci95"] else "")
            for e in report["effects"][:1] for name, p in list(e["parameters"].items())[:3]
        )  # fmt: skip
        truth = "; ".join(
            ", ".join(f"{k} {v:.3g}" for k, v in list(effect["values"].items())[:3]) for effect in result["truth"]
        )
        errors = (
            f"{report['before']['rmse']:.2f} -> {report['after']['rmse']:.2f} ({report['reference_rmse'] or 0:.2f})"
        )
        found.add_row(result["case"], outcome(result), named, parameters, truth, errors)
    return found
