"""How wrong a difference between two predictions of similar motion is, from held-out recordings of the model.

The error of one prediction says little about that of a difference: what the model has wrong on both sides cancels. An
error of the difference has two parts (ADR 63).

- Parts of the power that are wrong by a factor, such as a friction that is 5 % too small: they count by the difference
  of that part. Factors are regressed from the residual of held-out blocks (Bayesian linear regression; Bishop, Pattern
  Recognition and Machine Learning, 2006, 3.3); what was found and what stays unknown of them both count.
- What is left of the residual differs from motion to motion: by the variance between blocks of similar motion (a
  variogram at the shortest distance; Cressie 1993, 2.4). Along an unchanged path most of that cancels, too; it counts
  by how much the speeds differ (`Cycle.unlike_s`).

The width is then scaled so that 90 % of the differences between similar held-out blocks of different recordings lie
within: a scale, and no conformal guarantee, because the factors are fitted to the same blocks.
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

LEVEL = 0.9
_NORMAL = 1.645
"""Standard deviations on either side that hold 90 % of a normal distribution; the width is never less."""
BLOCK_S = 5.0
"""Over which an error of the model stays the same: the length of a move or a rest."""
_FEWEST = 20
"""Blocks, for an interval."""
_FACTOR = 0.3
"""Prior deviation of the relative error of a part."""


@dataclass(frozen=True, slots=True, eq=False)
class Doubt:
    """Errors of a model on recordings that it has not learned from."""

    causes: tuple[Cause, ...]
    factors: Floats
    """[c, c] second moments of the relative errors of the parts."""
    left: float
    """W^2 s: variance per second of motion that no factor explains."""
    width: float
    """Standard deviations on either side of a difference that hold 90 % of the held-out differences."""
    blocks: int
    recordings: int

    @classmethod
    def of(cls, model: Predictor, segments: Sequence[Segment]) -> Doubt | None:
        """From held-out segments; None from fewer than 20 blocks of 5 s or from one recording."""
        held_out = [segment for segment in segments if segment.split != "train"]
        rows = round(BLOCK_S / model.step_s)
        powers: list[dict[Cause, Floats]] = []
        errors, owners = [], []
        for segment in held_out:
            count = len(segment.P) // rows
            if not count:
                continue
            parts = parts_of(model, segment)
            predicted = np.sum([part.power for part in parts], axis=0)
            errors.append(_blocks(segment.P - predicted, count, rows))
            owners += [segment.recording] * count
            causes: dict[Cause, Floats] = {}
            for part in parts:
                causes[part.cause] = causes.get(part.cause, np.zeros(count)) + _blocks(part.power, count, rows)
            powers.append(causes)
        if len(owners) < _FEWEST or len(set(owners)) < 2:
            return None
        names = tuple(powers[0])
        by_cause = np.column_stack([np.concatenate([each[cause] for each in powers]) for cause in names])
        return cls._fitted(names, by_cause, np.concatenate(errors), np.array(owners))

    @classmethod
    def _fitted(cls, names: tuple[Cause, ...], power: Floats, error: Floats, owner: np.ndarray) -> Doubt:
        """From blocks [n, c] W of parts and [n] W of residual."""
        variance = float(error.var()) + 1e-12
        for _ in range(5):  # the scatter that the factors leave decides how well they are known
            unknown = np.linalg.inv(power.T @ power / variance + np.eye(len(names)) / _FACTOR**2)
            found = unknown @ power.T @ error / variance
            rest = error - power @ found
            variance = float(rest @ rest) / max(len(error) - len(names), 1) + 1e-12
        factors = np.outer(found, found) + unknown
        near = _nearest(power, owner)
        left = float(np.mean((rest - rest[near]) ** 2) / 2) * BLOCK_S
        change = power - power[near]
        expected = np.einsum("nc,cd,nd->n", change, factors, change) + 2 * left / BLOCK_S
        scores = np.abs(error - error[near]) / np.sqrt(np.maximum(expected, 1e-12))
        width = max(_NORMAL, float(np.quantile(scores, LEVEL)))
        return cls(names, factors, left, width, len(error), len(set(owner.tolist())))

    def half_width(self, before: Use, after: Use, unlike_s: float) -> float:
        """Half the width of the 90 % interval of a saving, J; `unlike_s` as in `Cycle.unlike_s`."""
        change = np.array([before.causes.get(cause, 0.0) - after.causes.get(cause, 0.0) for cause in self.causes])
        return self.width * float(np.sqrt(change @ self.factors @ change + self.left * unlike_s))


def _blocks(values: Floats, count: int, rows: int) -> Floats:
    return np.asarray(values[: count * rows].reshape(count, rows).mean(axis=1))


def _nearest(power: Floats, owner: np.ndarray) -> np.ndarray:
    """[n] the block of another recording whose parts are most similar."""
    scaled = power / np.maximum(power.std(axis=0), 1e-9 + 1e-6 * np.abs(power).max(axis=0))
    distance = ((scaled[:, None] - scaled[None]) ** 2).sum(axis=2)
    distance[owner[:, None] == owner[None]] = np.inf
    return np.asarray(distance.argmin(axis=1))
