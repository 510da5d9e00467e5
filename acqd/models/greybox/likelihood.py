"""What the recordings of one robot say of its parameters, without any prior: for a fleet that pools them.

The log-likelihood is taken as quadratic about the estimate. Its rows are correlated, and the model is not exact, so
that it claims to know more than it does. It is divided by the mean ratio of the variance of its gradient, clustered by
recording, to the variance that it claims (magnitude adjustment: Pauli, Racugno and Ventura 2011).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acqd.arrays import Floats
from acqd.models.bundle.bundle import Arrays
from acqd.models.greybox.normal_equations import NormalEquations
from acqd.models.greybox.parameters import Prior

_PREFIX = "likelihood."
_FEWEST_RECORDINGS = 3
"""Fewer tell nothing of the scatter between recordings."""


@dataclass(frozen=True, slots=True)
class Likelihood:
    """Log-likelihood -(x - values)' information (x - values) / 2 + score' (x - values), and the description's prior."""

    values: Floats
    """[p] estimate."""
    information: Floats
    """[p, p]."""
    score: Floats
    """[p] slope at the estimate, which a prior or a bound holds away from the maximum."""
    mean: Floats
    """[p] of the description's prior."""
    deviation: Floats
    """[p]."""
    inflation: float
    """By which the log-likelihood of the fit has been divided, at least 1."""

    @classmethod
    def of(
        cls, equations: NormalEquations, values: Floats, belief: Prior, described: Prior, divided: float = 1.0
    ) -> Likelihood:
        """From the normal equations at `values`; `belief`: the prior of the fit.

        `divided`: by how much the equations have divided the log-likelihood already.
        """
        information = equations.hessian - belief.precision_matrix()
        scores = np.array(list(equations.scores.values()))
        inflation = _inflation(equations.hessian, information, scores)
        return cls(
            values, information / inflation, -scores.sum(axis=0) / inflation, described.mean, described.deviation,
            divided * inflation,
        )  # fmt: skip

    @property
    def shift(self) -> Floats:
        """[p] of the log-likelihood -x' information x / 2 + shift' x."""
        return np.asarray(self.information @ self.values + self.score)

    def arrays(self) -> Arrays:
        """For weights.safetensors."""
        return {
            _PREFIX + "values": self.values, _PREFIX + "information": self.information, _PREFIX + "score": self.score,
            _PREFIX + "mean": self.mean, _PREFIX + "deviation": self.deviation,
            _PREFIX + "inflation": np.array([self.inflation]),
        }  # fmt: skip

    @classmethod
    def read(cls, arrays: Arrays) -> Likelihood | None:
        """The inverse of `arrays`; None for a bundle of an earlier version."""
        own = {
            name.removeprefix(_PREFIX): np.asarray(array, dtype=np.float64)
            for name, array in arrays.items()
            if name.startswith(_PREFIX)
        }
        if not own:
            return None
        return cls(
            own["values"], own["information"], own["score"], own["mean"], own["deviation"], float(own["inflation"][0])
        )


def _inflation(hessian: Floats, information: Floats, scores: Floats) -> float:
    """Variance of the gradient over the variance that the information claims, where the recordings say anything.

    `scores`: [recordings, p]. At least 1.
    """
    count = len(scores)
    if count < _FEWEST_RECORDINGS:
        return 1.0
    inverse = np.linalg.inv(hessian)
    away = scores - scores.mean(axis=0)
    varied = float(np.einsum("ri,ij,rj->", away, inverse, away)) * count / (count - 1)
    return max(varied / max(float(np.einsum("ij,ji->", inverse, information)), 1e-12), 1.0)
