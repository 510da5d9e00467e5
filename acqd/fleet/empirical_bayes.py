"""Mean and spread of the parameters of a type's robots, from what the recordings of each say (empirical Bayes).

The parameters of robot i are a draw from a normal distribution with the mean mu and independent variances t (each part
has its tolerance). Its recordings know some combinations of the parameters well and others not at all: their likelihood
has a full information matrix. Given t, mu and all robots are known in closed form. t maximises the marginal likelihood
(EM, Dempster, Laird and Rubin 1977; Morris 1983), with mu integrated out. So combinations that no robot knows alone are
known from all together, and the errors of single fits do not count as spread between robots.

A variance from a few robots may vanish by chance, and the next robot would not be allowed to differ. Parameters of a
kind (the viscous friction of all joints) therefore share a part of theirs, in units of the description's uncertainty.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from acqd.arrays import Floats

_ITERATIONS = 150
_CONVERGED = 0.01
"""Relative change of each variance."""
_USUAL_SPREAD = 0.1
"""Between robots, as a share of the description's uncertainty: where the recordings say nothing of the spread."""
_USUAL_WEIGHT = 0.01
"""Robots that the usual spread counts for."""
_KIND_WEIGHT = 4.0
"""Robots that the mean variance of the parameters of a kind counts for."""


@dataclass(frozen=True, slots=True)
class Evidence:
    """Log-likelihood -x' information x / 2 + shift' x of the parameters x of one robot."""

    information: Floats
    """[p, p]."""
    shift: Floats
    """[p]."""


@dataclass(frozen=True, slots=True)
class Learned:
    """What the robots have taught."""

    mean: Floats
    """[p]."""
    mean_covariance: Floats
    """[p, p] of the mean's error."""
    spread: Floats
    """[p] standard deviation between robots."""
    robots: int

    def predictive(self) -> Floats:
        """[p, p] covariance of a further robot about the mean; that of n robots' spread is a Student distribution's."""
        wider = (self.robots - 1) / (self.robots - 3)
        return np.asarray(self.mean_covariance + np.diag(wider * self.spread**2))


def learned(robots: Sequence[Evidence], mean: Floats, deviation: Floats, kinds: Sequence[str]) -> Learned:
    """From at least four robots, with the description's prior `mean` and `deviation` [p] for the type's mean.

    `kinds`: [p], the same for parameters whose spread is alike.
    """
    information = np.array([each.information * np.outer(deviation, deviation) for each in robots])
    shift = np.array([deviation * (each.shift - each.information @ mean) for each in robots])
    count, size = shift.shape
    unit, names = np.eye(size), np.array(list(kinds))
    shares = (names[:, None] == names[None, :]) / (names[:, None] == names[None, :]).sum(axis=1, keepdims=True)
    variance = np.full(size, _USUAL_SPREAD**2)  # all in units of the description's deviation
    for _ in range(_ITERATIONS):
        within = np.linalg.inv(information + np.diag(1 / variance))  # [n, p, p] of a robot, given the mean
        pull = within / variance[:, None]  # d(robot) / d(mean), transposed
        centre_covariance = np.linalg.inv(unit + count * np.diag(1 / variance) - pull.sum(axis=0) / variance[None, :])
        centre = centre_covariance @ np.einsum("nij,nj->i", pull, shift)
        own = np.einsum("nij,nj->ni", within, shift + centre / variance)
        moved = within / variance[None, None, :] - unit
        squares = (own - centre) ** 2 + np.diagonal(within, axis1=1, axis2=2)
        squares = squares + np.einsum("nij,jk,nik->ni", moved, centre_covariance, moved, optimize=True)
        before = variance
        usual = _KIND_WEIGHT * (shares @ variance) + _USUAL_WEIGHT * _USUAL_SPREAD**2
        variance = (squares.sum(axis=0) + usual) / (count + _KIND_WEIGHT + _USUAL_WEIGHT)
        if np.abs(np.log(variance / before)).max() < _CONVERGED:
            break
    scaled = deviation * centre
    return Learned(
        mean + scaled, centre_covariance * np.outer(deviation, deviation), deviation * np.sqrt(variance), count
    )
