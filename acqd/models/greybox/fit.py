"""Robust fit of a grey box: Gauss-Newton on power and, where logged, joint torques, with the description as prior."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats
from acqd.models.features import motion
from acqd.models.greybox.model import SMALL_TORQUE, GreyBox, direction, lagged, magnitude
from acqd.models.greybox.parameters import Layout, Prior, prior
from acqd.models.segments import SIGNALS, Segment
from acqd.numerics import mad_sigma
from acqd.robot.arm import Arm
from acqd.robot.description import RobotDescription
from acqd.robot.dynamics import inertial_parameters, regressor
from acqd.robot.newton_euler import Chain

_MOST_ROWS = 90_000
_ITERATIONS = 25
_HUBER = 2.0  # standard deviations beyond which a residual counts linearly
_ALIKE = 10.0  # neighbouring rows that say the same: so much less does each count against the prior
_LAG_STEP_S = 1e-3
_HELD = 1e-9
_MANY_RECORDINGS = 30


@dataclass(frozen=True, slots=True)
class Fit:
    """A fitted model and how sure its parameters are."""

    model: GreyBox
    covariance: Floats
    """[p, p], clustered by recording: rows of one recording are not independent."""
    sigma_W: float
    """Robust standard deviation of the residual."""


@dataclass(frozen=True, slots=True)
class _Part:
    """One stretch, with what does not change during the fit."""

    recording: str
    P: Floats
    q: Floats
    qd: Floats
    qdd: Floats
    Y: NDArray[np.float32]
    """[T, axes, 10 axes]: torque per inertial parameter."""
    tau: Floats | None
    signals: Floats


@dataclass(slots=True)
class _Normal:
    """Normal equations at one point."""

    hessian: Floats
    gradient: Floats
    cost: float
    by_recording: dict[str, Floats]
    sigma_W: float
    sigma_Nm: Floats | None


def fit_grey_box(
    robot: RobotDescription,
    segments: list[Segment],
    step_s: float,
    seed: int,
    progress: Callable[[float], None],
    withheld: tuple[str, ...] = (),
) -> Fit:
    """Parameters from training stretches; at most about an hour of them, drawn at random.

    Those of the groups `withheld` stay at nought.
    """
    signals = tuple(n for n in SIGNALS if all(n in s.signals for s in segments) and _varies(segments, n))
    layout = Layout(robot.axes, signals)
    arm = Arm(robot)
    chosen = _drawn(segments, seed)
    parts = [_part(arm, layout, segment, step_s) for segment in chosen]
    rest = float(np.percentile(np.concatenate([part.P for part in parts]), 2))
    belief = prior(layout, robot, inertial_parameters(arm), rest, step_s)
    usual = np.array([np.median(np.concatenate([s.signals[n] for s in segments])) for n in signals])
    low, high = layout.lowest(), np.full(layout.size, np.inf)
    high[layout.place("lag")] = 2.0 * step_s
    for group in withheld:
        belief.mean[layout.place(group)], belief.deviation[layout.place(group)] = 0.0, _HELD
        low[layout.place(group)] = 0.0
    values = np.clip(belief.mean, low, high)
    chain = Chain.of(robot)

    def make(x: Floats) -> GreyBox:
        return GreyBox(chain, layout, x, step_s, usual)

    now, damping = _normal(make(values), parts, belief, None), 1e-4
    for iteration in range(_ITERATIONS):
        scaled = now.hessian + damping * np.diag(np.diag(now.hessian))
        trial = np.clip(values - _free_step(scaled, now.gradient, values, low), low, high)
        then = _normal(make(trial), parts, belief, now)
        if then.cost < now.cost:
            done = now.cost - then.cost < 1e-5 * now.cost
            values, damping = trial, damping / 5
            now = _normal(make(values), parts, belief, None)  # spreads anew
            if done:
                break
        else:
            damping *= 10
            if damping > 1e6:
                break
        progress((iteration + 1) / _ITERATIONS)
    return Fit(make(values), _clustered(now, belief), now.sigma_W)


def _varies(segments: list[Segment], name: str) -> bool:
    return bool(np.ptp(np.concatenate([s.signals[name] for s in segments])) > 0)


def _drawn(segments: list[Segment], seed: int) -> list[Segment]:
    chosen, rows = [], 0
    for k in np.random.default_rng(seed).permutation(len(segments)):
        chosen.append(segments[k])
        rows += len(segments[k].P)
        if rows > _MOST_ROWS:
            break
    return chosen


def _part(arm: Arm, layout: Layout, segment: Segment, step_s: float) -> _Part:
    q, qd, qdd = motion(segment.q, step_s)
    Y = regressor(arm, q, qd, qdd).astype(np.float32)
    columns = [segment.signals[name] for name in layout.signals]
    signals = np.column_stack([np.zeros((len(q), 0)), *columns])
    return _Part(segment.recording, segment.P, q, qd, qdd, Y, segment.tau, signals)


def _jacobian(model: GreyBox, part: _Part) -> tuple[Floats, Floats]:
    """Prediction [T] and its derivatives [T, p]."""
    layout, step_s = model.layout, model.step_s
    lag = float(model.group("lag")[0])
    gain = float(model.group("gain")[0])
    J = np.zeros((len(part.P), layout.size))
    sign = direction(part.qd)
    _, motor = model.motor_torque(part.q, part.qd, part.qdd)
    on = np.reshape(model.drives_on(dict(zip(layout.signals, part.signals.T, strict=True))), (-1, 1))
    power_per_torque = 2 * model.group("copper") * motor + model.group("conduction") * motor / np.hypot(
        motor, SMALL_TORQUE
    )
    pull = on * (gain * part.qd + power_per_torque)  # dP/d(torque): mechanical power and losses
    J[:, layout.place("inertial")] = np.einsum("tjk,tj->tk", part.Y, pull, optimize=True)
    J[:, layout.place("rotor")] = pull * part.qdd
    J[:, layout.place("coulomb")] = pull * sign
    J[:, layout.place("viscous")] = pull * part.qd
    J[:, layout.place("copper")] = on * motor * motor
    J[:, layout.place("conduction")] = on * magnitude(motor)
    J[:, layout.place("gain")] = on * (motor * part.qd).sum(axis=1, keepdims=True)
    now = gain * J[:, layout.place("gain")][:, 0] + J[:, layout.place("copper")] @ model.group("copper")
    now += J[:, layout.place("conduction")] @ model.group("conduction")
    moved = lagged(J, lag, step_s)
    faster, slower = max(lag - _LAG_STEP_S, 0.0), lag + _LAG_STEP_S
    difference = lagged(now, slower, step_s) - lagged(now, faster, step_s)
    moved[:, layout.place("lag")] = (difference / (slower - faster))[:, None]
    moved[:, layout.place("signals")] = part.signals
    moved[:, layout.place("standby")] = 1.0
    predicted = lagged(now, lag, step_s) + part.signals @ model.group("signals") + model.group("standby")[0]
    return predicted, moved


def _normal(model: GreyBox, parts: list[_Part], belief: Prior, scale: _Normal | None) -> _Normal:
    """Robustly weighted; `scale` None finds the spreads of the residuals, else they are those of that point."""
    found = [(part, *_jacobian(model, part)) for part in parts]
    residuals = [predicted - part.P for part, predicted, _ in found]
    sigma_W = scale.sigma_W if scale else _spread(np.concatenate(residuals))
    inertial = model.layout.place("inertial")
    torque_off = [
        np.einsum("tjk,k->tj", part.Y, model.values[inertial]) - part.tau for part in parts if part.tau is not None
    ]
    sigma_Nm = None
    if torque_off:
        together = np.concatenate(torque_off)
        sigma_Nm = scale.sigma_Nm if scale else np.array([_spread(column) for column in together.T])
    off = iter(torque_off)
    size = model.layout.size
    hessian, gradient, cost = np.diag(belief.deviation**-2.0), (model.values - belief.mean) / belief.deviation**2, 0.0
    cost = 0.5 * float((gradient * (model.values - belief.mean)).sum())
    by_recording: dict[str, Floats] = {}
    for (part, _, J), residual in zip(found, residuals, strict=True):
        own = by_recording.setdefault(part.recording, np.zeros(size))
        weight, loss = _huber(residual / sigma_W)
        weight /= sigma_W**2 * _ALIKE
        pull = J.T @ (weight * residual)
        hessian += J.T @ (weight[:, None] * J)
        cost += loss / _ALIKE
        if part.tau is not None and sigma_Nm is not None:
            apart = next(off)
            weights, loss = _huber(apart / sigma_Nm)
            weights /= sigma_Nm**2 * _ALIKE
            Y = part.Y.reshape(-1, part.Y.shape[2])
            hessian[inertial, inertial] += Y.T @ (weights.reshape(-1, 1) * Y)
            pull[inertial] += Y.T @ (weights * apart).ravel()
            cost += loss / _ALIKE
        gradient = gradient + pull
        own += pull
    return _Normal(hessian, gradient, cost, by_recording, sigma_W, sigma_Nm)


def _huber(z: Floats) -> tuple[Floats, float]:
    """Weights, and the sum of the losses."""
    size = np.abs(z)
    weight = np.minimum(1.0, _HUBER / np.maximum(size, 1e-12))
    loss = np.where(size <= _HUBER, 0.5 * size**2, _HUBER * (size - 0.5 * _HUBER))
    return weight, float(loss.sum())


def _spread(values: Floats) -> float:
    return max(mad_sigma(values), 1e-3)


def _free_step(hessian: Floats, gradient: Floats, values: Floats, low: Floats) -> Floats:
    """Newton's step of what is not held at its bound."""
    held = (values <= low) & (gradient > 0)
    step = np.zeros_like(values)
    free = ~held
    step[free] = np.linalg.solve(hessian[np.ix_(free, free)], gradient[free])
    return step


def _clustered(normal: _Normal, belief: Prior) -> Floats:
    """Sandwich covariance with recordings as clusters, and the prior as one more observation.

    Few recordings say little about how recordings differ: then what rows alone say is added.
    """
    inverse = np.linalg.inv(normal.hessian)
    scores = np.array(list(normal.by_recording.values()))
    count = len(scores)
    meat = scores.T @ scores * (count / max(count - 1, 1)) + np.diag(belief.deviation**-2.0)
    sandwich = np.asarray(inverse @ meat @ inverse)
    return sandwich if count >= _MANY_RECORDINGS else sandwich + inverse
