"""Normal equations of the grey-box fit: robustly weighted power and joint torques, and a Gaussian prior."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats
from acqd.models.greybox.model import SMALL_TORQUE, GreyBox, lagged, magnitude
from acqd.models.greybox.parameters import Layout, Prior
from acqd.models.segments import Segment
from acqd.numerics import mad_sigma
from acqd.robot.newton_euler import Chain, regressor

_HUBER = 2.0  # standard deviations beyond which the loss is linear
CORRELATED_ROWS = 10.0
"""Neighbouring rows are not independent: so many count as one against the prior."""
_LAG_STEP_S = 1e-3
_MIN_SIGMA = 1e-3
_QUIETEST = 0.3
"""Least noise of a recording relative to that of all: an arm at rest says little about its motion."""


@dataclass(frozen=True, slots=True)
class Observations:
    """One segment with the quantities that stay the same during the fit."""

    recording: str
    P: Floats
    """[T] W."""
    q: Floats
    qd: Floats
    qdd: Floats
    Y: NDArray[np.float32]
    """[T, axes, 10 axes]: joint torque per inertial parameter (rigid-body regressor)."""
    tau: Floats | None
    """[T, axes] Nm, where it was logged."""
    signals: Floats
    """[T, k]."""

    @classmethod
    def of(cls, chain: Chain, layout: Layout, segment: Segment, step_s: float) -> Observations:
        """Motion and regressor of a segment."""
        q, qd, qdd = segment.motion(step_s)
        Y = regressor(chain, q, qd, qdd).astype(np.float32)
        columns = [segment.signals[name] for name in layout.signals]
        signals = np.column_stack([np.zeros((len(q), 0)), *columns])
        return cls(segment.recording, segment.P, q, qd, qdd, Y, segment.tau, signals)


@dataclass(frozen=True, slots=True)
class Scale:
    """Robust standard deviations of the residuals (median absolute deviation)."""

    sigma_W: float
    sigma_Nm: Floats | None
    """[axes]; None without logged torques."""
    noise: dict[str, float]
    """Of the power of each recording, relative to `sigma_W`: fast motion may have ten times the noise of slow motion,
    and a few loud recordings would decide instead of many quiet ones."""


@dataclass(frozen=True, slots=True)
class NormalEquations:
    """Gauss-Newton approximation of the cost at one point."""

    hessian: Floats
    """[p, p]."""
    gradient: Floats
    """[p]."""
    cost: float
    """Negative log posterior, up to a constant."""
    scores: dict[str, Floats]
    """Gradient [p] of each recording's share of the cost."""
    scale: Scale


def normal_equations(
    model: GreyBox,
    parts: list[Observations],
    belief: Prior,
    scale: Scale | None = None,
    correlated: float = CORRELATED_ROWS,
) -> NormalEquations:
    """Linearise the cost at the parameters of `model`; `scale` None: estimate it from the residuals there.

    `correlated`: rows that count as one.
    """
    linearised = [_jacobian(model, part) for part in parts]
    residuals = [part.P - predicted for part, (predicted, _) in zip(parts, linearised, strict=True)]
    inertial = model.layout.part("inertial")
    torque_residuals = [
        None if part.tau is None else part.tau - np.einsum("tjk,k->tj", part.Y, model.values[inertial])
        for part in parts
    ]
    scale = scale or _scale(parts, residuals, [residual for residual in torque_residuals if residual is not None])
    deviation = model.values - belief.mean
    hessian = belief.precision_matrix()
    gradient = hessian @ deviation
    cost = 0.5 * float((gradient * deviation).sum())
    scores: dict[str, Floats] = {}
    for part, (_, J), residual, torque_residual in zip(parts, linearised, residuals, torque_residuals, strict=True):
        sigma_W = scale.sigma_W * scale.noise[part.recording]
        weight, loss = _huber(residual / sigma_W)
        weight /= sigma_W**2 * correlated
        score = -(J.T @ (weight * residual))
        hessian += J.T @ (weight[:, None] * J)
        cost += loss / correlated
        if torque_residual is not None and scale.sigma_Nm is not None:
            weights, loss = _huber(torque_residual / scale.sigma_Nm)
            weights /= scale.sigma_Nm**2 * correlated
            Y = part.Y.reshape(-1, part.Y.shape[2])
            hessian[inertial, inertial] += Y.T @ (weights.reshape(-1, 1) * Y)
            score[inertial] -= Y.T @ (weights * torque_residual).ravel()
            cost += loss / correlated
        gradient = gradient + score
        scores[part.recording] = scores.get(part.recording, np.zeros(model.layout.size)) + score
    return NormalEquations(hessian, gradient, cost, scores, scale)


def _jacobian(model: GreyBox, part: Observations) -> tuple[Floats, Floats]:
    """Predicted power [T] W and its derivatives [T, p]."""
    layout, step_s = model.layout, model.step_s
    lag = float(model.group("lag")[0])
    gain = float(model.group("gain")[0])
    J = np.zeros((len(part.P), layout.size))
    sign = model.direction(part.qd)
    _, motor = model.motor_torque(part.q, part.qd, part.qdd)
    on = np.reshape(model.drives_on(dict(zip(layout.signals, part.signals.T, strict=True))), (-1, 1))
    loss_per_torque = 2 * model.group("copper") * motor + model.group("conduction") * motor / np.hypot(
        motor, SMALL_TORQUE
    )
    power_per_torque = on * (gain * part.qd + loss_per_torque)
    J[:, layout.part("inertial")] = np.einsum("tjk,tj->tk", part.Y, power_per_torque, optimize=True)
    J[:, layout.part("rotor")] = power_per_torque * part.qdd
    J[:, layout.part("coulomb")] = power_per_torque * sign
    J[:, layout.part("viscous")] = power_per_torque * part.qd
    J[:, layout.part("copper")] = on * motor * motor
    J[:, layout.part("conduction")] = on * magnitude(motor)
    J[:, layout.part("gain")] = on * (motor * part.qd).sum(axis=1, keepdims=True)
    undelayed = gain * J[:, layout.part("gain")][:, 0] + J[:, layout.part("copper")] @ model.group("copper")
    undelayed += J[:, layout.part("conduction")] @ model.group("conduction")
    turned = power_per_torque * model.group("coulomb") * model.direction_slope(part.qd)
    J[:, layout.part("sign_speed")] = turned.sum(axis=1, keepdims=True)
    J = lagged(J, lag, step_s)
    shorter, longer = max(lag - _LAG_STEP_S, 0.0), lag + _LAG_STEP_S
    difference = lagged(undelayed, longer, step_s) - lagged(undelayed, shorter, step_s)
    J[:, layout.part("lag")] = (difference / (longer - shorter))[:, None]
    J[:, layout.part("signals")] = part.signals
    J[:, layout.part("standby")] = 1.0
    predicted = lagged(undelayed, lag, step_s) + part.signals @ model.group("signals") + model.group("standby")[0]
    return predicted, J


def _scale(parts: list[Observations], residuals: list[Floats], torque_residuals: list[Floats]) -> Scale:
    sigma_W = _sigma(np.concatenate(residuals))
    rows: dict[str, list[Floats]] = {}
    for part, residual in zip(parts, residuals, strict=True):
        rows.setdefault(part.recording, []).append(residual)
    noise = {name: max(_sigma(np.concatenate(each)) / sigma_W, _QUIETEST) for name, each in rows.items()}
    if not torque_residuals:
        return Scale(sigma_W, None, noise)
    return Scale(sigma_W, np.array([_sigma(column) for column in np.concatenate(torque_residuals).T]), noise)


def _sigma(values: Floats) -> float:
    return max(mad_sigma(values), _MIN_SIGMA)


def _huber(z: Floats) -> tuple[Floats, float]:
    """Huber's weights of standardised residuals, and the sum of the losses."""
    size = np.abs(z)
    weight = np.minimum(1.0, _HUBER / np.maximum(size, 1e-12))
    loss = np.where(size <= _HUBER, 0.5 * size**2, _HUBER * (size - 0.5 * _HUBER))
    return weight, float(loss.sum())
