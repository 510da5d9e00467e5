"""The scale that makes right labels likeliest, and what it is worth on plants that it was not fitted to."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import minimize, minimize_scalar
from scipy.special import expit

from acqd.arrays import Floats
from acqd.discrepancy.causes.belief import NOTHING, OUTSIDE, Belief, Calibration, Scale
from tools.studies.causes.standings import Row

_START = (2.0, -2.0, 1.0, 0.5, 3.0, 0.5, -3.0)
"""Logarithms of slopes, offsets, and the logit of the share of misled cases."""
_RIDGE = 1e-3
"""Keeps slopes finite where classes are separable."""


def calibrated(rows: Sequence[Row], source: str, kept: Calibration | None = None) -> Calibration:
    """By maximum likelihood; the share of misled cases on plants that a scale has not seen.

    The shares of the classes in the study are the prior. `kept`: a calibration of other plants, of which only "nothing"
    and the share of misled cases are fitted; it keeps what tells hypotheses from each other, and their thresholds.
    """
    if kept is not None:
        return _nothing_fitted(rows, source, kept)
    scale = _fitted(rows)
    worlds = sorted({row.world for row in rows})
    if len(worlds) > 1:
        others = {name: _fitted([row for row in rows if row.world != name]) for name in worlds}
        scale = replace(scale, misled=_misled(rows, [others[row.world] for row in rows]))
    return Calibration.of(scale, ((row.standing, row.true) for row in rows), source)


def _nothing_fitted(rows: Sequence[Row], source: str, kept: Calibration) -> Calibration:
    above = np.log1p([max(row.standing.above_nothing, 0.0) for row in rows])
    clean = np.array([NOTHING in row.true for row in rows])

    def loss(parameters: Floats) -> float:
        logit = parameters[0] - np.exp(parameters[1]) * above
        return float(np.logaddexp(0, np.where(clean, -logit, logit)).mean() + _RIDGE * (parameters**2).sum())

    level, slope = minimize(loss, [3.0, 0.5], method="L-BFGS-B").x
    scale = replace(kept.scale, nothing=(float(level), float(np.exp(slope))))
    scale = replace(scale, misled=_misled(rows, [scale] * len(rows)))
    own = Calibration.of(scale, ((row.standing, row.true) for row in rows), source)
    least = {**kept.least, NOTHING: own.least[NOTHING]}
    return Calibration(scale, least, {**kept.cases, NOTHING: own.cases[NOTHING]}, source)


def _misled(rows: Sequence[Row], scales: Sequence[Scale]) -> float:
    """The likeliest share of cases whose evidence says nothing of the cause."""
    likelihoods = [scale.likelihoods(row.standing) for row, scale in zip(rows, scales, strict=True)]
    right = np.array([_right(each, row) for each, row in zip(likelihoods, rows, strict=True)])
    blind = np.array([len(row.true) / len(each) for each, row in zip(likelihoods, rows, strict=True)])

    def loss(share: float) -> float:
        return float(-np.log((1 - share) * right + share * blind).mean())

    return float(minimize_scalar(loss, bounds=(1e-3, 1 - 1e-3), method="bounded").x)


def _fitted(rows: Sequence[Row]) -> Scale:
    def loss(parameters: Floats) -> float:
        scale = _scale(parameters)
        reached = [_right(scale.probabilities(row.standing), row) for row in rows]
        return float(-np.log(np.maximum(reached, 1e-9)).mean() + _RIDGE * (parameters**2).sum())

    return _scale(minimize(loss, _START, method="L-BFGS-B").x)


def left_out(rows: Sequence[Row], kept: Calibration | None = None) -> list[Belief]:
    """Beliefs by calibrations on the other plants: what a plant that nobody has seen may expect."""
    worlds = {row.world for row in rows}
    by_world = {name: calibrated([row for row in rows if row.world != name], "", kept) for name in worlds}
    return [row.said if row.led else by_world[row.world].believed(row.standing) for row in rows]


def figures(rows: Sequence[Row], beliefs: Sequence[Belief]) -> dict[str, float]:
    """Coverage and size of sets, and what competitions of fault isolation ask: detected, false alarms, probabilities.

    A change is detected where "nothing" is no member of the set.
    """
    pairs = list(zip(rows, beliefs, strict=True))
    faults = [(row, belief) for row, belief in pairs if NOTHING not in row.true]
    clean = [belief for row, belief in pairs if NOTHING in row.true]
    known = [(row, belief) for row, belief in faults if OUTSIDE not in row.true]
    unknown = [(row, belief) for row, belief in faults if OUTSIDE in row.true]
    return {
        "cases": float(len(rows)),
        "coverage": _mean([bool(row.true & set(belief.members)) for row, belief in pairs]),
        "coverage_known": _mean([bool(row.true & set(belief.members)) for row, belief in known]),
        "coverage_unknown": _mean([OUTSIDE in belief.members for _, belief in unknown]),
        "coverage_nothing": _mean([NOTHING in belief.members for belief in clean]),
        "size": _mean([len(belief.members) for belief in beliefs]),
        "detected": _mean([NOTHING not in belief.members for _, belief in faults]),
        "false_alarms": _mean([NOTHING not in belief.members for belief in clean]),
        "probability_known": _mean([_right(belief.probabilities, row) for row, belief in known]),
        "probability_unknown": _mean([_right(belief.probabilities, row) for row, belief in unknown]),
        "log_loss": _mean([-np.log(max(_right(belief.probabilities, row), 1e-9)) for row, belief in pairs]),
    }


def reliability(rows: Sequence[Row], beliefs: Sequence[Belief]) -> list[dict[str, float]]:
    """Probability of the likeliest label against the share of cases in which that label is right."""
    first = [next(iter(belief.probabilities.items())) for belief in beliefs]
    right = np.array([label in row.true for (label, _), row in zip(first, rows, strict=True)])
    said = np.array([share for _, share in first])
    found = []
    for low, high in ((0.0, 0.5), (0.5, 0.8), (0.8, 0.9), (0.9, 0.95), (0.95, 1.01)):
        inside = (said >= low) & (said < high)
        if inside.any():
            found.append({"from": low, "cases": int(inside.sum()), "said": float(said[inside].mean()),
                          "right": float(right[inside].mean())})  # fmt: skip
    return found


def _scale(parameters: Floats) -> Scale:
    """Slopes are positive, and the share of misled cases lies between 0 and 1."""
    chance, columns, law, law_slope, nothing, nothing_slope, misled = parameters.tolist()
    chance, columns, law_slope, nothing_slope = np.exp([chance, columns, law_slope, nothing_slope]).tolist()
    return Scale(chance, columns, (law, law_slope), (nothing, nothing_slope), float(expit(misled)))


def _right(shares: dict[str, float] | object, row: Row) -> float:
    assert isinstance(shares, dict)
    return sum(shares.get(label, 0.0) for label in row.true)


def _mean(values: Sequence[float | bool]) -> float:
    return float(np.mean(values)) if values else float("nan")
