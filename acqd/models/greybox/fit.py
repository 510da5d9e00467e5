"""Robust fit of a grey box to power and, where logged, joint torques, with the robot description as prior.

Levenberg-Marquardt steps on Huber's loss, with bounds held as an active set.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from acqd.arrays import Floats
from acqd.models.greybox.fleet_prior import FleetPrior
from acqd.models.greybox.likelihood import Likelihood
from acqd.models.greybox.model import GreyBox
from acqd.models.greybox.normal_equations import CORRELATED_ROWS, NormalEquations, Observations, normal_equations
from acqd.models.greybox.parameters import Layout, Prior, prior
from acqd.models.segments import SIGNALS, Segment
from acqd.robot.description import RobotDescription
from acqd.robot.inertia import inertial_parameters
from acqd.robot.newton_euler import Chain

_MAX_ROWS = 90_000
_ITERATIONS = 25
_MAX_DAMPING = 1e6
_CONVERGED = 1e-5  # relative decrease of the cost
_WITHHELD_DEVIATION = 1e-9  # prior deviation that holds a parameter at zero
_MANY_RECORDINGS = 30


@dataclass(frozen=True, slots=True)
class Fit:
    """A fitted model and the uncertainty of its parameters."""

    model: GreyBox
    covariance: Floats
    """[p, p], clustered by recording, because rows of one recording are not independent."""
    sigma_W: float
    """Robust standard deviation of the residual."""
    likelihood: Likelihood
    """What the recordings say without a prior."""


def fit_grey_box(
    robot: RobotDescription,
    segments: list[Segment],
    step_s: float,
    seed: int,
    progress: Callable[[float], None],
    withheld: tuple[str, ...] = (),
    learned: FleetPrior | None = None,
) -> Fit:
    """Fit a grey box to training segments, at most about an hour of them, drawn at random.

    Parameters of the groups `withheld` stay zero. `learned`: what other robots of the type have taught.
    `progress` is called with the completed share.
    """
    signals = tuple(n for n in SIGNALS if all(n in s.signals for s in segments) and _varies(segments, n))
    layout = Layout(robot.axes, signals, robot.sliding)
    chain = Chain.of(robot)
    parts = [Observations.of(chain, layout, segment, step_s) for segment in _drawn(segments, seed)]
    standby_W = float(np.percentile(np.concatenate([part.P for part in parts]), 2))
    belief = prior(layout, robot, inertial_parameters(robot), standby_W, step_s)
    usual = np.array([np.median(np.concatenate([s.signals[n] for s in segments])) for n in signals])
    low, high = layout.lowest(), layout.highest(step_s)
    for group in withheld:
        belief.mean[layout.part(group)], belief.deviation[layout.part(group)] = 0.0, _WITHHELD_DEVIATION
        low[layout.part(group)] = 0.0
    described, correlated = belief, CORRELATED_ROWS
    if learned is not None:
        belief, correlated = learned.on(described, layout), CORRELATED_ROWS * learned.inflation
    values = np.clip(belief.mean, low, high)

    def make(x: Floats) -> GreyBox:
        return GreyBox(chain, layout, x, step_s, usual)

    now, damping = normal_equations(make(values), parts, belief, None, correlated), 1e-4
    for iteration in range(_ITERATIONS):
        damped = now.hessian + damping * np.diag(np.diag(now.hessian))
        trial = np.clip(values - _free_step(damped, now.gradient, values, low, high), low, high)
        then = normal_equations(make(trial), parts, belief, now.scale, correlated)
        if then.cost < now.cost:
            converged = now.cost - then.cost < _CONVERGED * now.cost
            values, damping = trial, damping / 5
            now = normal_equations(make(values), parts, belief, None, correlated)  # with the scale at the new point
            if converged:
                break
        else:
            damping *= 10
            if damping > _MAX_DAMPING:
                break
        progress((iteration + 1) / _ITERATIONS)
    alone = Likelihood.of(now, values, belief, described, correlated / CORRELATED_ROWS)
    return Fit(make(values), _clustered(now, belief), now.scale.sigma_W, alone)


def _varies(segments: list[Segment], name: str) -> bool:
    return bool(np.ptp(np.concatenate([s.signals[name] for s in segments])) > 0)


def _drawn(segments: list[Segment], seed: int) -> list[Segment]:
    chosen, rows = [], 0
    for k in np.random.default_rng(seed).permutation(len(segments)):
        chosen.append(segments[k])
        rows += len(segments[k].P)
        if rows > _MAX_ROWS:
            break
    return chosen


def _free_step(hessian: Floats, gradient: Floats, values: Floats, low: Floats, high: Floats) -> Floats:
    """Newton step [p] of the parameters that are not held at a bound."""
    held = ((values <= low) & (gradient > 0)) | ((values >= high) & (gradient < 0))
    step = np.zeros_like(values)
    free = ~held
    step[free] = np.linalg.solve(hessian[np.ix_(free, free)], gradient[free])
    return step


def _clustered(equations: NormalEquations, belief: Prior) -> Floats:
    """Sandwich covariance [p, p] with recordings as clusters, and the prior as one more observation.

    With fewer than 30 recordings the scatter between recordings is poorly known: the covariance for independent
    rows is then added.
    """
    inverse = np.linalg.inv(equations.hessian)
    scores = np.array(list(equations.scores.values()))
    count = len(scores)
    meat = scores.T @ scores * (count / max(count - 1, 1)) + belief.precision_matrix()
    sandwich = np.asarray(inverse @ meat @ inverse)
    return sandwich if count >= _MANY_RECORDINGS else sandwich + inverse
