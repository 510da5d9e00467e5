"""Stand-ins for columns that recordings lack: torques with an error, a tool that switches, a voltage that wanders.

They let the certificate judge a column that nobody has recorded. Torques are those of the model. Their error has the
memory of the power's residual, because both show what the rigid body leaves out; white noise of this size would
promise too much.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.signal import lfilter

from acqd.arrays import Floats
from acqd.discrepancy.joints.witness import Witness
from acqd.discrepancy.regression.design_columns import DesignColumns
from acqd.models.effects.catalogue.line_voltage import NOMINAL_V
from acqd.models.effects.scene import Scene
from acqd.models.effects.substeps import averaged
from acqd.models.segments import Segment
from acqd.motion.controller import BrakeSettings
from acqd.residual.logged_torque import Side
from acqd.residual.thresholds import NOISE
from acqd.robot.description import RobotDescription
from acqd.robot.newton_euler import regressor

TORQUE_ERROR = 0.01
"""RMS relative to the joint's greatest torque; the motor currents of a measured UR10e leave 0.008 of it unexplained."""
TOOL_S = 5.0
"""Between two switchings of the tool."""
VOLTAGE_WANDERS, _VOLTAGE_S = 0.01, 60.0
"""Relative standard deviation of the mains voltage, and the time in which it changes."""
_USUAL_V = NOMINAL_V[2]


def with_torques(columns: DesignColumns, robot: RobotDescription, side: Side) -> Witness | None:
    """What torques of sensors ("link") or motor currents would show in all recordings; None where nothing is shown."""
    errors = np.concatenate(columns.residual)
    errors = errors / max(float(errors.std()), 1e-9)
    random = np.random.default_rng(1)
    constant = np.array([joint.drive.effort_per_ampere for joint in robot.joint])
    segments = []
    for number, (segment, in_question) in enumerate(
        zip(columns.scenes.segments, columns.scenes.in_question, strict=True)
    ):
        scene = columns.scenes[number]
        torque = _of_the_arm(scene) if side == "link" else averaged(scene.tau)
        rows = np.arange(len(torque))[:, None] + random.integers(len(errors), size=torque.shape[1])
        torque = torque + TORQUE_ERROR * robot.effort * errors[rows % len(errors)]
        if side == "link":
            segments.append((replace(segment, tau=torque), in_question))
        else:
            channels = segment.channels | {"current": torque / constant}
            segments.append((replace(segment, tau=None, channels=channels), in_question))
    return Witness.of(columns.model, robot, segments, columns.scenes)


def _of_the_arm(scene: Scene) -> Floats:
    """[T, axes] Nm behind the gears, also while closed brakes hold the arm, where `tau_rigid` of the motors is 0."""
    Y = averaged(regressor(scene.model.chain, scene.q, scene.qd, scene.qdd))
    return np.asarray(Y @ scene.model.group("inertial"))


def with_signals(segments: Sequence[Segment], step_s: float) -> list[Segment]:
    """Segments with a brake that closes at rest, a tool that switches, and a mains voltage, where they lack these."""
    random = np.random.default_rng(1)
    found = []
    for segment in segments:
        rows = len(segment.P)
        tool = (np.arange(rows) * step_s // TOOL_S % 2).astype(np.float64)
        signals = {"brake": _open(segment, step_s), "tool": tool} | segment.signals
        channels = {"Vrms": _voltage(rows, step_s, random)} | segment.channels
        found.append(replace(segment, signals=signals, channels=channels))
    return found


def _open(segment: Segment, step_s: float) -> Floats:
    """[T] 1 while the brakes are open: they close where the arm rests for long."""
    moves = np.asarray((np.abs(segment.motion(step_s)[1]) > NOISE.stick_rad_s).any(axis=1))
    moves[0] = True
    rows = np.arange(len(moves))
    rests_s = (rows - np.maximum.accumulate(np.where(moves, rows, 0))) * step_s
    return np.asarray(rests_s <= BrakeSettings().close_after_s, dtype=np.float64)


def _voltage(rows: int, step_s: float, random: np.random.Generator) -> Floats:
    """[T] V of an Ornstein-Uhlenbeck process around the usual mains voltage."""
    keep = float(np.exp(-step_s / _VOLTAGE_S))
    steps = random.standard_normal(rows) * np.sqrt(1 - keep**2)
    wander, _ = lfilter([1.0], [1.0, -keep], steps, zi=[keep * random.standard_normal()])
    return np.asarray(_USUAL_V * (1 + VOLTAGE_WANDERS * wander))
