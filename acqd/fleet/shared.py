"""Causes that many robots share: found by the scan statistic, reported once, with who is excepted."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from acqd.fleet.scan import Cluster, Finding, clusters
from acqd.fleet.settings import FleetSettings
from acqd.fleet.size import main_parameter
from acqd.models.effects import library

_COMPATIBLE = 0.05
"""Confidence from which an alternative of a robot's cause may be the shared one."""


def shared_causes(robots: Sequence[dict[str, Any]], settings: FleetSettings) -> list[dict[str, Any]]:
    """Shared causes, the likeliest first; `robots` are rows of the fleet's table."""
    findings = [finding for robot in robots for finding in _findings(robot)]
    weights = dict.fromkeys(library(), 1.0) | settings.base_rates
    lengths_s = [3600 * hours for hours in settings.shared_hours]
    found = clusters(findings, weights, lengths_s, settings.shared_chance, settings.seed)
    return [_described(each, robots) for each in found]


def _findings(robot: dict[str, Any]) -> list[Finding]:
    """One finding per named cause."""
    if robot["state"] != "changed":
        return []
    screened = robot["screen"]
    onset = None if robot["since_before_s"] is not None else screened["onset_s"]
    return [
        Finding(robot["name"], kind, onset, screened["trained_s"], screened["last_s"])
        for kind in dict.fromkeys(effect["id"] for effect in robot["effects"])
    ]


def _described(cluster: Cluster, robots: Sequence[dict[str, Any]]) -> dict[str, Any]:
    members = set(cluster.robots)
    judged = [robot for robot in robots if robot["state"] in ("changed", "unchanged")]
    excepted = [robot["name"] for robot in judged if robot["name"] not in members]
    return {
        "cause": cluster.kind,
        "summary": library()[cluster.kind].summary if cluster.kind in library() else "",
        "robots": sorted(members),
        "perhaps": [robot["name"] for robot in judged if robot["name"] not in members and _compatible(robot, cluster)],
        "excepted": excepted,
        "since_s": None if cluster.window_s is None else list(cluster.window_s),
        "expected": cluster.expected,
        "p": cluster.p,
        "test": "Kulldorff's scan statistic over kinds of causes and windows of time, Monte Carlo with 999 draws",
        "sizes": _sizes(cluster, [robot for robot in judged if robot["name"] in members]),
    }


def _compatible(robot: dict[str, Any], cluster: Cluster) -> bool:
    """Whether a changed robot's cause may be the shared one: by its alternatives, and by its onset."""
    if robot["state"] != "changed":
        return False
    if cluster.window_s is not None and robot["since_before_s"] is None:
        begin, end = cluster.window_s
        if not begin - 600 <= robot["since_s"] <= end + 600:
            return False
    near = {rival["name"] for e in robot["effects"] for rival in e["rivals"] if rival["confidence"] >= _COMPATIBLE}
    near |= {member["id"] for effect in robot["effects"] for member in effect["family"]["members"]}
    return cluster.kind in near


def _sizes(cluster: Cluster, members: Sequence[dict[str, Any]]) -> dict[str, Any] | None:
    """Median and range of the main parameter of the first robot's cause; None where names or units differ."""
    sizes = [next(e["parameters"] for e in robot["effects"] if e["id"] == cluster.kind) for robot in members]
    known = [parameters for parameters in sizes if parameters]
    name = main_parameter(known[0]) if known else None
    if name is None or len({(p.get(name) or {}).get("unit") for p in known}) > 1:
        return None
    values = np.array([float(parameters[name]["value"]) for parameters in known])
    return {
        "parameter": name, "unit": known[0][name]["unit"], "median": float(np.median(values)),
        "lowest": float(values.min()), "highest": float(values.max()), "robots": len(values),
    }  # fmt: skip
