"""How wrong a difference between two predictions of similar motion is, from held-out recordings of the model.

The error of one prediction says little about that of a difference: what the model has wrong on both sides cancels. An
error of the difference has two parts (ADR 64).

- Parts of the power that are wrong by a factor, such as a friction that is 5 % too small: they count by the difference
  of that part. Factors are regressed from the residual of held-out blocks (Bayesian linear regression; Bishop, Pattern
  Recognition and Machine Learning, 2006, 3.3 and 3.5); what was found and what stays unknown of them both count. How
  wrong parts usually are is not set: prior deviations are averaged over, weighted by their evidence.
- What is left of the residual differs from motion to motion: by the variance between successive blocks (von Neumann
  1941). The zero of a meter and the warmth of gears wander in minutes, whatever the arm does; they are the same on
  both sides of a difference, and nearly so in successive blocks. Along an unchanged path most of the rest cancels, too;
  it counts by how much the speeds differ (`Cycle.unlike_s`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from acqd.arrays import Floats
from acqd.models.causes import parts_of
from acqd.models.effects.cause import Cause
from acqd.models.predictor import Predictor
from acqd.models.segments import Segment
from acqd.saving.power import Use

_NORMAL = 1.645
"""Standard deviations on either side that hold 90 % of a normal distribution."""
BLOCK_S = 5.0
"""Over which an error of the model stays the same: the length of a move or a rest."""
_FEWEST = 20
"""Blocks, for an interval."""
_FACTORS = (0.003, 0.006, 0.01, 0.02, 0.04, 0.08, 0.15, 0.3)
"""Prior deviations of the relative error of a part that are compared."""
_ROUNDS = 8


@dataclass(frozen=True, slots=True, eq=False)
class Doubt:
    """Errors of a model on recordings that it has not learned from."""

    causes: tuple[Cause, ...]
    factors: Floats
    """[c, c] second moments of the relative errors of the parts."""
    left: float
    """W^2 s: variance per second of motion that no factor explains."""
    blocks: int
    recordings: int

    @classmethod
    def of(cls, model: Predictor, segments: Sequence[Segment]) -> Doubt | None:
        """From held-out segments; None from fewer than 20 blocks of 5 s, from one recording, or one block a session."""
        held_out = sorted((each for each in segments if each.split != "train"), key=lambda each: each.start_s)
        rows = round(BLOCK_S / model.step_s)
        powers: list[dict[Cause, Floats]] = []
        errors, owners, days = [], [], []
        for segment in held_out:
            count = len(segment.P) // rows
            if not count:
                continue
            parts = parts_of(model, segment)
            predicted = np.sum([part.power for part in parts], axis=0)
            errors.append(_blocks(segment.P - predicted, count, rows))
            owners += [segment.recording] * count
            days += [segment.session] * count
            causes: dict[Cause, Floats] = {}
            for part in parts:
                causes[part.cause] = causes.get(part.cause, np.zeros(count)) + _blocks(part.power, count, rows)
            powers.append(causes)
        if len(owners) < _FEWEST or len(set(owners)) < 2 or len(_successive(np.array(days))) < _FEWEST // 2:
            return None
        names = tuple(powers[0])
        by_cause = np.column_stack([np.concatenate([each[cause] for each in powers]) for cause in names])
        factors, variance = _fitted(by_cause, np.concatenate(errors), np.array(days))
        return cls(names, factors, variance * BLOCK_S, len(owners), len(set(owners)))

    def half_width(self, before: Use, after: Use, unlike_s: float) -> float:
        """Half the width of the 90 % interval of a saving, J; `unlike_s` as in `Cycle.unlike_s`."""
        change = np.array([before.causes.get(cause, 0.0) - after.causes.get(cause, 0.0) for cause in self.causes])
        return _NORMAL * float(np.sqrt(change @ self.factors @ change + self.left * unlike_s))


def _blocks(values: Floats, count: int, rows: int) -> Floats:
    return np.asarray(values[: count * rows].reshape(count, rows).mean(axis=1))


def _successive(day: np.ndarray) -> np.ndarray:
    """Numbers of the blocks whose next block is of the same session."""
    return np.flatnonzero(day[1:] == day[:-1])


def _fitted(power: Floats, error: Floats, day: np.ndarray) -> tuple[Floats, float]:
    """[c, c] second moments of the factors, and the variance that they leave, W^2.

    From blocks in the order of time: [n, c] W of parts, [n] W of residual, [n] session. Differences of successive
    blocks of a session are regressed: the level of a session is free, and what wanders in minutes does not count.
    """
    successive = _successive(day)
    x = np.diff(power, axis=0)[successive] / np.sqrt(2)
    y = np.diff(error)[successive] / np.sqrt(2)
    square, count = x.T @ x, len(y)
    moments, variances, evidences = [], [], []
    for prior in _FACTORS:
        variance = float(y @ y) / count + 1e-12
        for _ in range(_ROUNDS):  # the scatter that the factors leave decides how well they are known
            unknown = np.linalg.inv(square / variance + np.eye(x.shape[1]) / prior**2)
            found = unknown @ x.T @ y / variance
            taken = float(np.trace(unknown @ square)) / variance  # effective number of parameters
            left = y - x @ found
            variance = float(left @ left) / max(count - taken, 1.0) + 1e-12
        _, log_det = np.linalg.slogdet(np.eye(x.shape[1]) + prior**2 / variance * square)
        evidences.append(-(count * np.log(variance) + log_det + y @ left / variance) / 2)
        moments.append(np.outer(found, found) + unknown)
        variances.append(variance)
    weights = np.exp(np.array(evidences) - max(evidences))
    weights /= weights.sum()
    return np.tensordot(weights, moments, 1), float(weights @ variances)
