"""The fleet's table: one row per robot, what is shared, and what the numbers rest on; plain JSON throughout."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from acqd.fleet.false_discovery import adjusted
from acqd.fleet.settings import Fleet, FleetSettings
from acqd.fleet.shared import shared_causes

Row = dict[str, Any]


@dataclass(frozen=True, slots=True)
class FleetReport:
    """What a run found."""

    robots: list[Row]
    shared: list[dict[str, Any]]
    tests: dict[str, Any]
    """Number of robots in the test, method and rate."""

    @property
    def failed(self) -> int:
        """Robots that could not be judged, or whose loop failed."""
        return sum(robot["error"] is not None for robot in self.robots)

    @property
    def changed(self) -> list[Row]:
        """Robots that have changed, the surest first."""
        rows = [robot for robot in self.robots if robot["state"] == "changed"]
        return sorted(rows, key=lambda row: (row["q"], row["p"], row["name"]))

    def as_json(self) -> dict[str, Any]:
        """report.json."""
        return {"robots": self.robots, "shared": self.shared, "tests": self.tests, "failed": self.failed}


def judged(screened: Sequence[Mapping[str, Any]], settings: FleetSettings) -> list[Row]:
    """A row per robot; those that could be screened are changed or unchanged at the rate of false discoveries."""
    known = [each for each in screened if "screen" in each]
    q = adjusted(np.array([each["screen"]["p"] for each in known]), settings.method)
    rates = {each["name"]: float(value) for each, value in zip(known, q, strict=True)}
    return [_row(each, rates.get(each["name"]), settings.false_discoveries) for each in screened]


def _row(each: Mapping[str, Any], q: float | None, rate: float) -> Row:
    screened = each.get("screen")
    changed = q is not None and q <= rate
    # the first recording in question is changed already: since when is only bounded
    from_start = screened is not None and screened["onset_s"] < screened["first_end_s"]
    return {
        "name": each["name"],
        "type": each.get("type"),
        "state": "failed" if screened is None else "changed" if changed else "unchanged",
        "error": each.get("error"),
        "p": None if screened is None else screened["p"],
        "q": q,
        "since_s": screened["onset_s"] if changed and screened is not None else None,
        "since_before_s": screened["first_s"] if changed and screened is not None and from_start else None,
        "rmse": None if screened is None else screened["rmse"],
        "reference_rmse": None if screened is None else screened["reference_rmse"],
        "verdict": None,
        "effects": [],
        "report": None,
        "shared": None,
        "notes": [f"log left out: {line}" for line in each.get("refused", [])],
        "dataset": each.get("dataset"),
        "screen": screened,
    }


def report_of(
    fleet: Fleet, rows: list[Row], causes: Mapping[str, Mapping[str, Any]], EUR_per_kWh: float | None = None
) -> FleetReport:
    """Rows with causes, and what they share; with a mean price, also the cost of a year."""
    rows = [_with_cause(row, causes.get(row["name"]), EUR_per_kWh) for row in rows]
    devices = {robot.name: robot.device for robot in fleet.robots}
    rows = [row | {"device": devices.get(row["name"])} for row in rows]
    shared = shared_causes(rows, fleet.settings)
    number = {name: k for k, each in enumerate(shared, start=1) for name in each["robots"]}
    rows = [row | {"shared": number.get(row["name"])} for row in rows]
    tested = sum(row["p"] is not None for row in rows)
    tests = {
        "robots": tested, "method": fleet.settings.method, "false_discoveries": fleet.settings.false_discoveries,
        "changed": sum(row["state"] == "changed" for row in rows),
    }  # fmt: skip
    return FleetReport(rows, shared, tests)


def _with_cause(row: Row, result: Mapping[str, Any] | None, price: float | None) -> Row:
    if result is None:
        return row
    if "error" in result:
        return row | {"error": result["error"]}
    cause = result["cause"]
    notes = [*row["notes"], *([cause["reason"]] if cause["reason"] else [])]
    effects = [_priced(effect, price) for effect in cause["effects"]]
    told = {"verdict": cause["verdict"], "effects": effects, "report": cause["report"], "notes": notes}
    return row | told | {"joint_names": cause.get("joint_names", [])}


def _priced(effect: dict[str, Any], price: float | None) -> dict[str, Any]:
    """An effect with the cost of its energy of a year: prices change more often than causes are searched."""
    year = effect.get("a_year")
    if year is None or price is None:
        return effect
    bounds = year["kWh_ci95"]
    cost = {"EUR": price * year["kWh"], "EUR_per_kWh": price,
            "EUR_ci95": None if bounds is None else [price * each for each in bounds]}  # fmt: skip
    return {**effect, "a_year": year | cost}
