"""What a foreign plant draws from the mains while it executes a motion; what a proposal does to the limits."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline

from tools.studies.foreign.generator import meter
from tools.studies.foreign.generator.arm import Floats
from tools.studies.foreign.generator.dynamics import joint_torques
from tools.studies.foreign.generator.motion import STEP_S, Motion
from tools.studies.foreign.generator.plant import Plant, Session, flow
from tools.studies.saving.programs import Executed

WARM = 0.95
"""Of the gears at the start: 0 cold, 1 warm."""
_BEFORE = 400
"""Rows at rest before and after, so that the lag of the supply and the last window are complete."""
_LOG_EVERY, _ANGLE_NOISE_RAD = 2, 2e-5


def energy(plant: Plant, motion: Executed, brake_open: Floats) -> float:
    """J of the motion at the mains, without the noise of a meter; `brake_open` [T] 0 or 1."""
    rows = len(motion.q)

    def around(values: Floats) -> Floats:
        return np.concatenate([np.repeat(values[:1], _BEFORE, axis=0), values, np.repeat(values[-1:], _BEFORE, axis=0)])

    q, qd, qdd = around(motion.q), around(motion.qd), around(motion.qdd)
    t = np.asarray(STEP_S * np.arange(len(q)))
    whole = Motion(t, q, qd, qdd, (slice(_BEFORE, _BEFORE + rows),), np.zeros(len(q)))
    rigid = joint_torques(plant.arm, plant.arm.bodies, q, qd, qdd)
    friction = plant.friction.torque(q, qd, rigid, WARM)
    still = np.zeros(len(q))
    session = Session(plant, whole, rigid, friction, around(brake_open), still, still + 231.0, still)
    power = np.repeat(flow(session, []).power, meter.WINDOW_ROWS)
    rest = (power[0], power[-1])  # before and after, where only the lag still tells of the motion
    extra = (power[:_BEFORE] - rest[0]).sum() + (power[_BEFORE + rows :] - rest[1]).sum()
    return float(power[_BEFORE : _BEFORE + rows].sum() + extra) * STEP_S


def write_log(path: Path, motion: Executed, signals: bool, random: np.random.Generator) -> None:
    """The log that the controller writes."""
    q = motion.q[::_LOG_EVERY] + random.normal(0, _ANGLE_NOISE_RAD, motion.q[::_LOG_EVERY].shape)
    names = ["time", *(f"q{k + 1}" for k in range(q.shape[1])), *(["brake"] if signals else [])]
    lines = [",".join(names)]
    for k, row in enumerate(q):
        cells = [f"{k * _LOG_EVERY * STEP_S:.3f}", *(f"{value:.7f}" for value in row), *(["1"] if signals else [])]
        lines.append(",".join(cells))
    path.write_text("\n".join([*lines, ""]))


def replayed(text: str, rows: int) -> Executed:
    """A CSV of timed joints as the controller of the plant interpolates it, `rows` long; the arm rests at its end.

    A log ends up to two rows before the motion does. Those rows must not count as saved.
    """
    table = np.array([line.split(",") for line in text.splitlines()[1:]], dtype=float)
    spline = CubicSpline(table[:, 0], table[:, 1:], bc_type="clamped")
    t = np.minimum(STEP_S * np.arange(rows), table[-1, 0])
    return Executed(spline(t), spline(t, 1), spline(t, 2))


def greatest(plant: Plant, motion: Executed) -> dict[str, Floats]:
    """The greatest speed [rad/s], acceleration [rad/s^2] and torque [Nm] of every joint in a motion."""
    torque = joint_torques(plant.arm, plant.arm.bodies, motion.q, motion.qd, motion.qdd)
    values = {"speed": motion.qd, "acceleration": motion.qdd, "torque": torque}
    return {name: np.abs(each).max(axis=0) for name, each in values.items()}


def violations(plant: Plant, motion: Executed, before: dict[str, Floats]) -> list[str]:
    """Limits of the described arm that a motion exceeds by more than 2 %, and the original does not (`greatest`)."""
    arm = plant.arm
    found = [
        name
        for name, value in greatest(plant, motion).items()
        if (value > 1.02 * np.maximum(getattr(arm, name), before[name])).any()
    ]
    outside = (motion.q < arm.lower).any() or (motion.q > arm.upper).any()
    return [*found, "position"] if outside else found
