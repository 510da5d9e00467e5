"""Forward and inverse kinematics of the flange."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from acqd.arrays import Floats
from acqd.robot.arm import Arm

_DAMPING = 1e-8
_MAX_STEP = 0.4  # rad or m a joint may move per iteration: larger steps leave the region where the Jacobian holds


@dataclass(frozen=True, slots=True)
class Pose:
    """Pose of the flange in the base frame."""

    position: Floats
    """[3], m."""
    rotation: Floats
    """[3, 3]."""


def forward_kinematics(arm: Arm, q: Floats) -> tuple[Floats, Floats]:
    """Flange positions [T, 3] (m) and rotations [T, 3, 3] for joint positions `q` [T, axes] (rad or m)."""
    positions, rotations = np.empty((len(q), 3)), np.empty((len(q), 3, 3))
    for k, row in enumerate(q):
        pin.framesForwardKinematics(arm.model, arm.data, row)
        placement = arm.data.oMf[arm.flange]
        positions[k], rotations[k] = placement.translation, placement.rotation
    return positions, rotations


def flange_jacobian(arm: Arm, q: Floats) -> Floats:
    """Jacobian [T, 6, axes] of the flange: three linear rows (m/rad or m/m), then three angular ones; base axes."""
    frame = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    return np.array([pin.computeFrameJacobian(arm.model, arm.data, row, arm.flange, frame) for row in q])


def inverse_kinematics(
    arm: Arm,
    pose: Pose,
    seed: Floats,
    random: np.random.Generator,
    *,
    restarts: int = 60,
    tolerance: float = 1e-7,
) -> Floats | None:
    """Joint angles [axes] within the limits that reach `pose`, or None.

    Damped Newton iteration on SE(3) from `seed`, then from `restarts` random configurations. The angles are
    clamped to the limits at every step, so that a redundant arm finds a posture inside them.
    `tolerance` holds for position (m) and orientation (rad) together.
    """
    lower, upper = arm.description.lower, arm.description.upper
    start = np.clip(seed, lower, upper)
    sliding = list(arm.description.sliding)
    low, high = np.maximum(lower, -np.pi), np.minimum(upper, np.pi)
    low[sliding], high[sliding] = lower[sliding], upper[sliding]
    for _ in range(restarts + 1):
        solution = _iterate(arm, pose, start, lower, upper, tolerance)
        if solution is not None:
            whole = unwound(solution, seed, lower, upper)
            whole[sliding] = solution[sliding]  # metres have no turns
            return whole
        start = random.uniform(low, high)
    return None


def unwound(q: Floats, near: Floats, lower: Floats, upper: Floats) -> Floats:
    """The same posture without whole turns: as near to `near` [axes] as the limits allow."""
    turns = np.round((q - near) / (2 * np.pi)) * 2 * np.pi
    fewer = q - turns
    return np.where((fewer >= lower) & (fewer <= upper), fewer, q)


def _iterate(arm: Arm, pose: Pose, start: Floats, lower: Floats, upper: Floats, tolerance: float) -> Floats | None:
    wanted = pin.SE3(pose.rotation, pose.position)
    q = start.copy()
    best, stalled = np.inf, 0
    for _ in range(80):
        pin.framesForwardKinematics(arm.model, arm.data, q)
        offset = arm.data.oMf[arm.flange].actInv(wanted)
        error = pin.log6(offset).vector
        size = float(np.linalg.norm(error))
        if size < tolerance:
            return q
        stalled = stalled + 1 if size > 0.9 * best else 0
        best = min(best, size)
        if stalled > 12:
            return None
        jacobian = pin.computeFrameJacobian(arm.model, arm.data, q, arm.flange)
        damping = _DAMPING + 1e-3 * min(size, 1.0) ** 2
        step = _step(jacobian, error, damping)
        # an axis that the step would drive through its stop is held; the other axes take over
        held = ((q <= lower) & (step < 0)) | ((q >= upper) & (step > 0))
        if held.any():
            jacobian[:, held] = 0.0
            step = _step(jacobian, error, damping)
        largest = np.abs(step).max()
        q = np.clip(q + step * min(1.0, _MAX_STEP / max(largest, 1e-12)), lower, upper)
    return None


def _step(jacobian: Floats, error: Floats, damping: float) -> Floats:
    """Damped least squares (Levenberg-Marquardt) step of the joint angles [axes]."""
    step: Floats = jacobian.T @ np.linalg.solve(jacobian @ jacobian.T + damping * np.eye(6), error)
    return step
