"""Sums of products of white rows per session, with the random zeros and friction of the session projected out."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acqd.arrays import Floats
from acqd.discrepancy.thresholds import THRESHOLDS
from acqd.numerics import mad_sigma


@dataclass(frozen=True, slots=True)
class Products:
    """Columns of a hypothesis [k] with each other, with the base model's columns [b], and with the residual."""

    own: Floats
    """[k, k]."""
    base: Floats
    """[k, b]."""
    residual: Floats
    """[k]."""

    def __add__(self, other: Products) -> Products:
        return Products(self.own + other.own, self.base + other.base, self.residual + other.residual)

    def times(self, weight: float) -> Products:
        """Of so many copies of the session."""
        return Products(weight * self.own, weight * self.base, weight * self.residual)

    def taken(self, columns: list[int]) -> Products:
        """Of some of the hypothesis' columns."""
        return Products(self.own[np.ix_(columns, columns)], self.base[columns], self.residual[columns])


@dataclass(frozen=True, slots=True)
class Session:
    """A log, or all pieces of a cut log."""

    name: str
    in_question: bool
    base: Floats
    """[b, b]."""
    residual: Floats
    """[b]."""

    def marginal(self, columns: Products, random: slice, deviation: Floats) -> Products:
        """Products of a hypothesis with the session's random parameters integrated out (Schur complement)."""
        inner = self.base[random, random] + np.diag(deviation**-2.0)
        cross = columns.base[:, random]
        solved = np.linalg.solve(inner, np.column_stack([cross.T, self.base[random], self.residual[random]]))
        k, b = len(columns.own), len(self.base)
        return Products(
            columns.own - cross @ solved[:, :k], columns.base - cross @ solved[:, k : k + b],
            columns.residual - cross @ solved[:, -1],
        )  # fmt: skip

    def marginal_base(self, random: slice, deviation: Floats) -> tuple[Floats, Floats]:
        """[b, b] and [b] of the base model with the session's random parameters integrated out."""
        inner = self.base[random, random] + np.diag(deviation**-2.0)
        solved = np.linalg.solve(inner, np.column_stack([self.base[random], self.residual[random]]))
        across = self.base[:, random]
        return self.base - across @ solved[:, :-1], self.residual - across @ solved[:, -1]


def random_deviations(sessions: list[Session], random: slice, prior: Floats, usual: Floats) -> Floats:
    """Standard deviations of the random parameters over reference sessions, about the common base model.

    Robust over the sessions; with few sessions, `usual` [r] counts as that many more sessions (shrinkage).
    """
    estimates = np.array([
        np.linalg.solve(s.base[random, random] + np.diag(prior[random] ** -2.0), s.residual[random])
        for s in sessions if not s.in_question
    ])  # fmt: skip
    weight = THRESHOLDS.few_sessions
    spread = np.array([mad_sigma(column, 0.0) for column in estimates.T])
    count = len(estimates)
    return np.asarray(np.sqrt((weight * usual**2 + count * spread**2) / (weight + count)) + 1e-6)
