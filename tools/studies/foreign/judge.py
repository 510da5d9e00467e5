"""What a result is worth: right, second, wrong, unknown, silent; whether the interval holds the truth."""

from __future__ import annotations

import tomllib
from functools import cache
from pathlib import Path
from typing import Any

from tools.studies.foreign.generator.hidden.catalogue import OUTSIDE

Result = dict[str, Any]
OUTCOMES = ("right", "second", "wrong", "unknown", "unclear", "silent", "error")


def kind(result: Result) -> str:
    """clean, pair, outside or single."""
    truth = result["truth"]
    if len(truth) != 1:
        return "pair" if truth else "clean"
    return "outside" if truth[0]["id"] in OUTSIDE else "single"


def named(result: Result) -> list[dict[str, Any]]:
    """Effects that the report names, strongest first."""
    return list(result["report"]["effects"]) if result["report"] else []


def accepts(true_id: str, effect: dict[str, Any], axes: int) -> bool:
    """Whether an effect of a report counts as the true one (families.toml)."""
    if effect["id"] == true_id:
        return True
    return any(
        family["true"] == true_id and family["named"] == effect["id"] and _fits(family, effect, axes)
        for family in families()
    )


@cache
def families() -> list[dict[str, Any]]:
    """Names that count as right besides the true one, with reasons."""
    return list(tomllib.loads((Path(__file__).parent / "families.toml").read_text())["family"])


def matched(result: Result) -> tuple[list[int | None], list[int]]:
    """Per true effect the number of the effect that names it (None: none does), and the numbers of spurious effects.

    A true effect accepts one name; a second name for it is spurious.
    """
    effects = named(result)
    left = list(range(len(effects)))
    hits: list[int | None] = []
    for true in result["truth"]:
        exact = [k for k in left if effects[k]["id"] == true["id"]]
        near = [k for k in left if accepts(true["id"], effects[k], result["axes"])]
        hit = min(exact or near, default=None)
        hits.append(hit)
        if hit is not None:
            left.remove(hit)
    return hits, left


def outcome(result: Result) -> str:
    """One of OUTCOMES; for clean sets and effects outside of the library, `wrong` is any name."""
    if result["error"]:
        return "error"
    effects = named(result)
    if kind(result) in ("single", "pair"):
        hits, _ = matched(result)
        if 0 in hits:
            return "right"
        if any(hit is not None for hit in hits):
            return "second"
    if effects:
        return "wrong"
    verdicts = {"unknown_structure": "unknown", "not_identifiable": "unclear"}
    return verdicts.get(result["report"]["verdict"], "silent")


def both(result: Result) -> bool:
    """Whether a pair's effects are both named."""
    return not result["error"] and None not in matched(result)[0]


def harmed(result: Result) -> bool:
    """Whether the held-out error is larger after than before."""
    report = result["report"]
    return bool(report) and report["after"]["rmse"] > report["before"]["rmse"] + 1e-9


def excess_left(result: Result) -> float | None:
    """Share of the squared held-out error above the reference's that a corrected model leaves; None: not corrected."""
    report = result["report"]
    if not report or not report.get("correction"):
        return None
    usual = report["reference_rmse"] or 0.0
    before, after = (report[when]["rmse"] ** 2 - usual**2 for when in ("before", "after"))
    return max(after, 0.0) / before if before > 0 else None


def intervals(result: Result) -> list[bool]:
    """Per effect named by its own id at its own place: whether its 95 % interval holds the true parameter."""
    found = []
    effects = named(result)
    for true, hit in zip(result["truth"], matched(result)[0], strict=True):
        if hit is None or true["value"] is None or effects[hit]["id"] != true["id"]:
            continue
        own = _parameter_at(effects[hit], true["where"])
        if own and own["unit"] == true["unit"] and own["ci95"]:
            found.append(bool(own["ci95"][0] <= true["value"] <= own["ci95"][1]))
    return found


def shapes(result: Result) -> list[bool]:
    """Per true shape of an effect named by its own id at its own place: whether its 95 % interval holds the truth."""
    found = []
    effects = named(result)
    for true, hit in zip(result["truth"], matched(result)[0], strict=True):
        if hit is None or effects[hit]["id"] != true["id"] or not _parameter_at(effects[hit], true["where"]):
            continue
        own = effects[hit]["parameters"]
        ends = [(own[name]["ci95"], value) for name, value in true["details"].items() if name in own]
        found += [bool(interval[0] <= value <= interval[1]) for interval, value in ends if interval]
    return found


def _parameter_at(effect: dict[str, Any], place: str) -> dict[str, Any] | None:
    """The first parameter at a place ("flange, beside its axis" is at the flange), or that of a joint of all joints."""
    if effect["where"].partition(",")[0] == place:
        return next(iter(effect["parameters"].values()), None)
    if effect["where"] == "each joint":
        return next((value for name, value in effect["parameters"].items() if name.endswith(place)), None)
    return None


def said(result: Result) -> list[tuple[float, bool]]:
    """Confidence of every named effect, and whether the name is right."""
    hits, _ = matched(result)
    return [(float(effect["confidence"]), number in hits) for number, effect in enumerate(named(result))]


def _fits(family: dict[str, Any], effect: dict[str, Any], axes: int) -> bool:
    if "last_links" in family:
        link = int("".join(digit for digit in effect["where"] if digit.isdigit()) or 0)
        if link <= axes - family["last_links"]:
            return False
    wanted = family.get("parameter", "")
    return any(name.startswith(wanted) for name in effect["parameters"])
