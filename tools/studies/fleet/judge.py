"""What the fleet's report is worth: found, false discoveries, names, onsets, and whether the shared cause is shared."""

from __future__ import annotations

from typing import Any

import numpy as np

from tools.studies.foreign.judge import accepts

_AXES = 7


def judged(report: dict[str, Any], secrets: dict[str, dict[str, Any]]) -> dict[str, Any]:
    """Figures of one run."""
    robots = {robot["name"]: robot for robot in report["robots"]}
    hidden = [name for name, secret in secrets.items() if secret["cause"]]
    changed = [name for name, robot in robots.items() if robot["state"] == "changed"]
    false = [name for name in changed if not secrets[name]["cause"]]
    found = [name for name in hidden if name in changed]
    right = [name for name in found if _right(robots[name], secrets[name])]
    late = [abs(robots[name]["since_s"] - secrets[name]["onset_s"]) / 60 for name in found]
    return {
        "robots": len(robots), "hidden": len(hidden), "found": len(found), "missed": sorted(set(hidden) - set(changed)),
        "false": false, "false_share": len(false) / max(len(changed), 1), "named": len(right),
        "onset_error_min": float(np.median(late)) if late else None, "failed": report["failed"],
        "shared": _shared(report, secrets),
    }  # fmt: skip


def _right(robot: dict[str, Any], secret: dict[str, Any]) -> bool:
    return any(accepts(secret["cause"], effect, _AXES) for effect in robot["effects"])


def _shared(report: dict[str, Any], secrets: dict[str, dict[str, Any]]) -> dict[str, Any] | None:
    """The reported cluster with the most robots of the shared cause; None where nothing is shared."""
    true = {name for name, secret in secrets.items() if secret["shared"]}
    best = max(report["shared"], key=lambda each: len(true & set(each["robots"])), default=None)
    if best is None:
        return None
    members = set(best["robots"])
    cause = next(secret["cause"] for secret in secrets.values() if secret["shared"])
    return {
        "cause": best["cause"], "right": best["cause"] == cause,
        "members": len(members), "true": len(true), "of_true": len(members & true), "wrong": sorted(members - true),
        "p": best["p"], "clusters": len(report["shared"]),
    }  # fmt: skip
