"""Summary of results: numbers for machines, and tables."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
from rich.table import Table

from acqd.report.digits import percent
from tools.studies.foreign.judge import (
    OUTCOMES,
    Result,
    both,
    excess_left,
    harmed,
    intervals,
    kind,
    matched,
    named,
    outcome,
    said,
    shapes,
)

_BINS = (0.0, 0.5, 0.7, 0.8, 0.9, 0.95, 1.0 + 1e-9)
"""Limits of the bins of said confidence."""


def summary(results: list[Result]) -> dict[str, Any]:
    """All rates with their counts."""
    groups: dict[str, list[Result]] = {}
    for result in results:
        groups.setdefault(_group(result), []).append(result)
    pairs = [r for r in results if kind(r) == "pair"]
    left = [share for r in results if outcome(r) == "unknown" and (share := excess_left(r)) is not None]
    covered = [hit for r in results for hit in intervals(r)]
    return {
        "cases": len(results),
        "groups": {name: _counts(groups[name]) for name in sorted(groups)},
        "spurious": _rate([bool(matched(r)[1]) for r in results if kind(r) in ("single", "pair")]),
        "clean_named": _rate([bool(named(r)) for r in results if kind(r) == "clean"]),
        "clean_named_or_unknown": _rate([outcome(r) in ("wrong", "unknown") for r in results if kind(r) == "clean"]),
        "pairs_both": _rate([both(r) for r in pairs]),
        "intervals_hold": _rate(covered),
        "shape_intervals_hold": _rate([hit for r in results for hit in shapes(r)]),
        "harm": _rate([harmed(r) for r in results]),
        "unknown_corrected": _rate([bool(r["report"].get("correction")) for r in results if outcome(r) == "unknown"]),
        "excess_left_median": float(np.median(left)) if left else None,
        "errors": _rate([bool(r["error"]) for r in results]),
        "lags_within_10_ms": _rate([abs(error) <= 0.010 for r in results for error in _lag_errors(r)]),
        "lag_worst_ms": max((1000 * abs(error) for r in results for error in _lag_errors(r)), default=0.0),
        "reliability": reliability(results),
        "seconds_median": {
            step: float(np.median([r["seconds"][step] for r in results if step in r["seconds"]] or [np.nan]))
            for step in ("generate", "build", "close")
        },
    }


def row(result: Result) -> dict[str, Any]:
    """One case for machines: truth, what was said about it, and what that is worth."""
    report = result["report"] or {}
    keys = (
        "case", "world", "axes", "seed", "amount", "torques", "strength", "truth", "clock", "lag_errors_s", "error",
        "seconds",
    )  # fmt: skip
    return {key: result.get(key) for key in keys} | {
        "outcome": outcome(result),
        "verdict": report.get("verdict"),
        "named": [
            {key: effect.get(key) for key in ("id", "where", "parameters", "confidence", "evidence", "added")}
            for effect in named(result)
        ],
        "spurious": [named(result)[number]["id"] for number in matched(result)[1]],
        "intervals_hold": intervals(result),
        "held_out_rmse_W": {key: report.get(key, {}).get("rmse") for key in ("before", "after")},
        "reference_rmse_W": report.get("reference_rmse"),
        "unexplained": report.get("unexplained"),
        "joint_level": report.get("joint_level"),
    }


def changes(results: list[Result], others: list[Result], label: str) -> Table:
    """Cases whose outcome or spurious names differ between two labels."""
    table = Table("plant", "case", "outcome", "names", f"outcome of {label}", "names", title=f"against {label}")
    before = {(other["world"], other["case"]): other for other in others}
    for result in results:
        other = before.get((result["world"], result["case"]))
        if other and _standing(other) != _standing(result):
            table.add_row(result["world"], result["case"], *_standing(result), *_standing(other))
    return table


def _standing(result: Result) -> tuple[str, str]:
    return outcome(result), ", ".join(effect["id"] for effect in named(result))


def reliability(results: list[Result]) -> list[dict[str, float]]:
    """Per bin of said confidence: names, mean confidence, share of right names."""
    pairs = np.array([pair for result in results for pair in said(result)], dtype=float).reshape(-1, 2)
    rows = []
    for low, high in pairwise(_BINS):
        own = pairs[(pairs[:, 0] >= low) & (pairs[:, 0] < high)]
        if len(own):
            rows.append(
                {"from": low, "names": len(own), "said": float(own[:, 0].mean()), "right": float(own[:, 1].mean())}
            )
    return rows


def tables(results: list[Result]) -> list[Table]:
    """Rates, reliability, cases."""
    figures = summary(results)
    return [_rates(figures), _overall(figures), _reliability(figures), _cases(results)]


def _group(result: Result) -> str:
    sort = kind(result)
    order = {"clean": 0, "single": 1, "pair": 2, "outside": 3}[sort]
    return f"{order} {sort}" + (f" {result['strength']:2d} %" if result["strength"] else "")


def _lag_errors(result: Result) -> list[float]:
    """s per recording, where the alignment had to find the lag."""
    found = result["clock"]["ahead_s"] != 0.0
    return list(result["lag_errors_s"].values()) if found else []


def _counts(results: list[Result]) -> dict[str, int]:
    found = [outcome(result) for result in results]
    return {"cases": len(results)} | {name: found.count(name) for name in OUTCOMES}


def _rate(hits: list[bool]) -> dict[str, int]:
    return {"of": len(hits), "hits": sum(hits)}


def _rates(figures: dict[str, Any]) -> Table:
    table = Table("cases", "n", *OUTCOMES, title="what the first name is worth (simulated, foreign plant)")
    for name, counts in figures["groups"].items():
        table.add_row(name[2:], str(counts["cases"]), *(str(counts[key] or "") for key in OUTCOMES))
    return table


def _overall(figures: dict[str, Any]) -> Table:
    table = Table("share", "hits", "of", "%")
    for name, rate in figures.items():
        if not isinstance(rate, dict) or "hits" not in rate:
            continue
        share = f"{100 * rate['hits'] / rate['of']:.0f}" if rate["of"] else "-"
        table.add_row(name.replace("_", " "), str(rate["hits"]), str(rate["of"]), share)
    left = figures["excess_left_median"]
    table.add_row("squared excess that corrections leave, median", "", "", "-" if left is None else f"{100 * left:.0f}")
    return table


def _reliability(figures: dict[str, Any]) -> Table:
    table = Table("confidence from", "names", "said %", "right %", title="reliability of said confidence")
    for row in figures["reliability"]:
        table.add_row(f"{row['from']:.2f}", str(row["names"]), f"{100 * row['said']:.0f}", f"{100 * row['right']:.0f}")
    return table


def _cases(results: list[Result]) -> Table:
    table = Table("plant", "case", "outcome", "truth", "named", "interval", "RMSE W before > after (reference)", "s")
    for result in results:
        table.add_row(*_case(result))
    return table


def _case(result: Result) -> tuple[str, ...]:
    truth = "; ".join(
        f"{t['where']} {t['value'] if t['value'] is not None else t['size']:.3g}" for t in result["truth"]
    )
    report = result["report"]
    if report is None:
        return result["world"], result["case"], outcome(result), truth, result["error"], "", "", ""
    names = "; ".join(_named(effect) for effect in report["effects"]) or report["verdict"]
    if report["effects"] and report["verdict"] != "effects_found":
        names += f" ({report['verdict']})"
    held = ", ".join("holds" if hit else "misses" for hit in intervals(result))
    errors = f"{report['before']['rmse']:.2f} > {report['after']['rmse']:.2f} ({report['reference_rmse'] or 0:.2f})"
    seconds = f"{sum(result['seconds'].values()):.0f}"
    return result["world"], result["case"], outcome(result), truth, names, held, errors, seconds


def _named(effect: dict[str, Any]) -> str:
    """The effect with its largest parameter, of those with an interval if there are any."""
    fitted = {name: value for name, value in effect["parameters"].items() if value["ci95"]} or effect["parameters"]
    name, largest = max(fitted.items(), key=lambda item: abs(item[1]["value"]))
    where = name if effect["where"] == "each joint" else effect["where"]
    ends = f" [{largest['ci95'][0]:.3g}, {largest['ci95'][1]:.3g}]" if largest["ci95"] else ""
    return f"{effect['id']} {where} {largest['value']:.3g}{ends} {largest['unit']} {percent(effect['confidence'])}"
