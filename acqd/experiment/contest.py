"""How likely the loop is to name the right one of a few causes, by what recordings say of their columns.

The rules are those of the selection. With all other columns projected out, a cause of size theta has the precision s
of its size, and a rival explains the share rho^2 of it (`ability.pairs`). The cause is told

- from nothing, if its estimate passes what evidence and differences of unchanged sessions ask (`ability.smallest`);
- from a rival, if the lead u^2, and what the rival pays more, exceed the margin 2 log(kinds / pi) + kappa^2 s theta^2,
  and the least confidence beside the rival (`selection.confidence`). There u^2 = s theta^2 (1 - rho^2) is twice the
  expected log Bayes factor between the two, which scatters by 2 u (Vuong 1989), and by what sessions differ by;
- from a law without a name, unless the law is ahead by that margin: names are preferred (ADR 26);
- by recordings that are held out, which have to be likelier with the cause (`repair.guard`, `repair.correcting`).

The closest failure decides: the distance to it, in standard deviations, is the criterion of T-optimal designs (Atkinson
and Fedorov 1975). The right name has the probability of that distance by Student's t, times 1 - pi, as the loop's
confidence has (ADR 103), over the causes by what they are believed and over their sizes by their posterior (ADR 49). A
program is chosen by the same sum with a heavier tail, Student's t with two degrees of freedom: the distance of a design
is an estimate, so that a lead of ten deviations is worth more than one of three, and a cause that no motion can tell
does not decide which program the others get (ADR 106).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky, solve_triangular

from acqd import student
from acqd.arrays import Floats
from acqd.discrepancy.regression.design_columns import Candidate
from acqd.discrepancy.regression.gram import Indices
from acqd.discrepancy.regression.least_squares import LEAST_POWER, Moments
from acqd.discrepancy.selection.ranking import part_of
from acqd.discrepancy.thresholds import THRESHOLDS
from acqd.discrepancy.thresholds.chance import by_chance
from acqd.experiment.rivals import Group, grouped

_NODES, _WEIGHTS = np.polynomial.hermite_e.hermegauss(7)
"""Of sizes, for a normal posterior."""
_NEVER = -1e3
"""Of columns that never act."""


@dataclass(frozen=True, slots=True, eq=False)
class Cause:
    """A cause that is compared."""

    candidate: Candidate
    weights: Floats
    """[columns] of the candidate's columns, of size 1; several parameters keep their fitted proportions."""
    size: float
    """Posterior mean, in the unit of the parameter; 1 for several parameters."""
    deviation: float
    """Posterior standard deviation, what sessions differ by included."""
    bounds: tuple[float, float]
    """Physical bounds of the size."""
    priors: Floats
    """[k] prior deviations of the candidate's parameters."""
    evidence: float
    """Twice the log Bayes factor against nothing in the recordings so far."""
    believed: float
    """Probability where something has changed; the rest is that of causes that are not compared."""
    between_sessions: tuple[float, float]
    """Variance of the size where nothing has changed, and its degrees of freedom."""
    with_another: tuple[float, float]
    """The same with one more session: what differs from day to day averages out."""

    def sizes(self) -> tuple[Floats, Floats]:
        """Sizes [n] of the posterior within the bounds of the parameter, and their weights [n]."""
        return np.clip(self.size + self.deviation * _NODES, *self.bounds), _WEIGHTS / _WEIGHTS.sum()


@dataclass(frozen=True, slots=True, eq=False)
class _SoFar:
    """What the recordings so far say of causes beside their rivals."""

    precision: Floats
    """[causes] of their sizes."""
    ahead: Floats
    """[rivals, causes] evidence that a cause is ahead of a rival."""
    beside: Floats
    """[rivals, causes] precision of a cause's size beside a rival."""
    pays: Floats
    """[rivals, causes] what a rival pays more than a cause."""

    @classmethod
    def nothing(cls, rivals: int, causes: int) -> _SoFar:
        """Without recordings."""
        return cls(np.zeros(causes), *(np.zeros((rivals, causes)) for _ in range(3)))


@dataclass(frozen=True, slots=True, eq=False)
class Contest:
    """Causes, and everything that might be said in their place."""

    causes: tuple[Cause, ...]
    rivals: tuple[Candidate, ...]
    used: Indices
    """Columns of causes and rivals; moments have these."""
    groups: tuple[Group, ...]
    same_kind: NDArray[np.bool_]
    """[rivals, causes] whether a rival is another place or shape of a cause."""
    has_to_lead: NDArray[np.bool_]
    """[rivals, causes] whether a rival is a law and the cause has a name: the law has to be ahead by the margin."""
    precision: Floats
    """[own] of the priors of the regression's columns."""
    learning_rate: float
    kinds: int
    recordings: int
    """In question so far."""
    so_far: _SoFar
    another: bool = False
    """Whether moments hold another session beside the recordings so far."""

    @classmethod
    def of(
        cls, causes: tuple[Cause, ...], rivals: Sequence[Candidate], priors: Sequence[Floats], precision: Floats,
        learning_rate: float, kinds: int, recordings: int,
    ) -> Contest:  # fmt: skip
        """`priors`: per rival [parameters] its prior deviations; `precision` [own] of the regression's columns."""
        used = np.unique(np.concatenate([each.indices for each in [*rivals, *(cause.candidate for cause in causes)]]))
        shape = len(rivals), len(causes)
        same = np.array([[rival.kind == cause.candidate.kind for cause in causes] for rival in rivals], dtype=bool)
        leads = np.array([[not rival.id and bool(c.candidate.id) for c in causes] for rival in rivals], dtype=bool)
        return cls(
            causes, tuple(rivals), used, grouped(used, rivals, priors), same.reshape(shape), leads.reshape(shape),
            precision, learning_rate, kinds, recordings, _SoFar.nothing(*shape),
        )  # fmt: skip

    def since(self, moments: Moments, evidence: Mapping[str, float]) -> Contest:
        """Beside what the recordings so far say: their moments, and the evidence of hypotheses in them by key."""
        schur = self._schur(moments)
        explained, complexity = self._rivals(schur)
        of_rivals = np.array([evidence.get(rival.key, 0.0) for rival in self.rivals])
        of_causes = np.array([cause.evidence for cause in self.causes])
        precision = np.array([self._precision(schur, cause) for cause in self.causes])
        pays = np.array([self._pays(schur, cause) for cause in self.causes])
        return replace(
            self,
            so_far=_SoFar(
                precision, of_causes - of_rivals[:, None], precision * (1 - explained), complexity[:, None] - pays
            ),
        )

    def probabilities(self, moments: Moments) -> Floats:
        """[causes] probability that the loop names a cause where that is what has changed; at most 1 - pi."""
        pairs = zip(self.causes, self._distances(moments), strict=True)
        wins = [float(weights @ student.cdf(z, self._between(cause)[1])) for cause, (z, weights) in pairs]
        return (1 - THRESHOLDS.chance) * np.array(wins)

    def score(self, moments: Moments) -> float:
        """What a design is worth: the expected probability of the right name by a distance that is an estimate."""
        tailed = np.array([float(weights @ _of_estimate(z)) for z, weights in self._distances(moments)])
        return float(np.array([cause.believed for cause in self.causes]) @ tailed)

    def closest(self, moments: Moments) -> list[str]:
        """Per cause what is said most easily in its place; "" where nothing explains any of it."""
        schur = self._schur(moments)
        explained, complexity = self._rivals(schur)
        found = []
        for number, cause in enumerate(self.causes):
            to_rivals = self._beside(schur, number, explained, complexity)
            at = to_rivals @ cause.sizes()[1] if len(self.rivals) else np.empty(0)
            found.append(_name(self.rivals[int(at.argmin())]) if np.isfinite(at).any() else "")
        return found

    def explained(self, moments: Moments) -> Floats:
        """[rivals, causes] share of a cause's evidence that a rival explains."""
        return self._rivals(self._schur(moments))[0]

    def _schur(self, moments: Moments) -> Floats:
        normal = moments.normal.copy()
        diagonal = np.diag_indices(len(normal))
        normal[diagonal] += self.precision + 1e-9 * np.maximum(normal[diagonal], 1e-9)
        lower = cholesky(normal, lower=True, check_finite=False)
        white = solve_triangular(lower, moments.cross, lower=True, check_finite=False)
        return np.asarray(moments.squares - white.T @ white)

    def _distances(self, moments: Moments) -> list[tuple[Floats, Floats]]:
        """Per cause: distance to the closest failure in standard deviations, and weight, of every size."""
        schur = self._schur(moments)
        explained, complexity = self._rivals(schur)
        return [
            (self._distance(schur, number, explained, complexity), cause.sizes()[1])
            for number, cause in enumerate(self.causes)
        ]

    def _distance(self, schur: Floats, number: int, explained: Floats, complexity: Floats) -> Floats:
        """[sizes] to the closest failure: too little evidence, a rival, or recordings that are held out."""
        cause = self.causes[number]
        precision, theta = self._precision(schur, cause), cause.sizes()[0]
        if precision < self.learning_rate * LEAST_POWER:
            return np.full(len(theta), _NEVER)
        variance, freedom = self._between(cause)
        chance = by_chance(self.kinds)
        improbable = _improbable(chance, freedom)
        least = max(
            float(np.sqrt((chance + self._pays(schur, cause)) / precision)), improbable * float(np.sqrt(variance))
        )
        known = min(float(self.so_far.precision[number]) / precision, 1.0)
        alone = (np.abs(theta + known * (cause.size - theta)) - least) / np.sqrt(1 / precision + variance)
        beside = self._beside(schur, number, explained, complexity).min(axis=0, initial=np.inf)
        return np.asarray(np.maximum(np.minimum.reduce([alone, beside, _held_out(cause, precision)]), _NEVER))

    def _beside(self, schur: Floats, number: int, explained: Floats, complexity: Floats) -> Floats:
        """[rivals, sizes] distance of a cause to a rival; infinite where it explains nothing.

        `explained` [rivals, causes] share of a cause's evidence, `complexity` [rivals] that a rival pays. The lead so
        far is what it is; expected is what more recordings add.
        """
        cause, leads, explained = self.causes[number], self.has_to_lead[:, number], explained[:, number]
        precision, theta, so_far = self._precision(schur, cause), cause.sizes()[0], self.so_far
        beside = precision * np.maximum(1 - explained, 1e-9)[:, None]
        more = np.maximum(beside - so_far.beside[:, number, None], 0.0) * theta**2
        pays = complexity[:, None] - self._pays(schur, cause) - so_far.pays[:, number, None]
        ahead = so_far.ahead[:, number, None] + more + pays
        scatter = np.maximum(2 * np.sqrt(beside * theta**2 * (1 + beside * self._between(cause)[0])), 1e-9)
        # what wrong columns may move; a law draws of a cause what it explains of the cause
        moved = THRESHOLDS.column_error**2 * precision * theta**2 * np.where(leads, explained, 1.0)[:, None]
        margin, wide = by_chance(self.kinds) + moved, np.hypot(scatter, moved / THRESHOLDS.interval_width)
        least = np.where(leads[:, None], self._sure * wide - margin, np.maximum(margin, self._sure * wide))
        return np.where(explained[:, None] > 0, (ahead - least) / scatter, np.inf)

    @property
    def _sure(self) -> float:
        """Errors by which a lead has to exceed zero for the least confidence, as `selection.confidence` asks."""
        wins = THRESHOLDS.least_confidence / (1 - THRESHOLDS.chance)
        return float(student.ppf(wins, self.recordings - 1 + THRESHOLDS.few_sessions))

    def _between(self, cause: Cause) -> tuple[float, float]:
        """Variance of the cause's size between sessions, and its degrees of freedom."""
        return cause.with_another if self.another else cause.between_sessions

    def _precision(self, schur: Floats, cause: Cause) -> float:
        """Of the size of a cause, everything that the regression knows projected out."""
        return self.learning_rate * float(cause.weights @ self._crossed(schur, cause)[self._positions(cause)])

    def _pays(self, schur: Floats, cause: Cause) -> float:
        """Evidence that a cause pays for its parameters, places and shapes."""
        return 2 * float(np.log(cause.candidate.tried)) + self._complexity(schur, cause)

    def _complexity(self, schur: Floats, cause: Cause) -> float:
        """log det(I + D S D) of a cause's parameters."""
        positions = self._positions(cause)
        block, _ = part_of(schur, schur[0], positions, cause.candidate)
        scaled = np.eye(len(block)) + self.learning_rate * cause.priors[:, None] * block * cause.priors
        return float(np.linalg.slogdet(scaled)[1])

    def _positions(self, cause: Cause) -> Indices:
        return np.asarray(np.searchsorted(self.used, cause.candidate.indices))

    def _crossed(self, schur: Floats, cause: Cause) -> Floats:
        """[used] products of all columns with the power of a cause of size 1."""
        return np.asarray(schur[:, self._positions(cause)] @ cause.weights)

    def _rivals(self, schur: Floats) -> tuple[Floats, Floats]:
        """[rivals, causes] share of a cause's evidence that a rival explains, 0 for other places of the same effect.

        And [rivals] what a rival pays for its parameters, places and shapes: log det(I + D S D) + 2 log(tried).
        """
        cross = np.column_stack([self._crossed(schur, cause) for cause in self.causes])
        power = np.array([cause.weights @ cross[self._positions(cause), k] for k, cause in enumerate(self.causes)])
        shares, pays = np.zeros((len(self.rivals), len(self.causes))), np.zeros(len(self.rivals))
        for group in self.groups:
            acting, drawn, asked = group.explained(schur, cross, self.learning_rate)
            shares[acting], pays[acting] = drawn, asked
        shares[self.same_kind] = 0.0
        return np.clip(shares / np.maximum(power, LEAST_POWER), 0.0, 1.0), pays


def _held_out(cause: Cause, precision: float) -> Floats:
    """[sizes] distance to held-out recordings that are no likelier with the cause.

    They are one to `held_out_every - 1` of those that `precision` is from. What the posterior of the size pays there is
    the logarithm of both; a law has to be likelier by what chance gives.
    """
    every = THRESHOLDS.held_out_every
    least = np.log(every / (every - 1)) if cause.candidate.id else by_chance(1)
    u = np.maximum(np.abs(cause.sizes()[0]) * np.sqrt(precision / (every - 1)), 1e-9)
    return np.asarray((u**2 - least) / (2 * u))


@cache
def _improbable(chance: float, freedom: float) -> float:
    """Deviations of Student's t that are as improbable as `chance` of evidence."""
    return float(student.isf(np.exp(-chance / 2) / 2, freedom))


def _of_estimate(distance: Floats) -> Floats:
    """Probability of a distance by Student's t with two degrees of freedom, in closed form."""
    return np.asarray((1 + distance / np.sqrt(2 + distance**2)) / 2)


def _name(candidate: Candidate) -> str:
    return f"{candidate.id} ({candidate.label})" if candidate.id else candidate.label


def together(parts: list[Moments]) -> Moments:
    """Moments of several sets of blocks."""
    return Moments(
        sum((part.normal for part in parts[1:]), parts[0].normal),
        sum((part.cross for part in parts[1:]), parts[0].cross),
        sum((part.squares for part in parts[1:]), parts[0].squares),
    )
