"""Replay of a recorded motion: a robot's log becomes smooth joint motion at 1 kHz."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import butter, sosfiltfilt

from acqd.arrays import Floats
from acqd.errors import InputError
from acqd.motion.controller import RATE, Motion
from acqd.robot.description import RobotDescription
from acqd.robot.log import RobotLog, require_rising

_CUTOFF_HZ = 8.0  # keeps encoder steps out of the accelerations
_LONGEST_GAP_S = 1.0
_MOVING_RAD_S = 2e-3


def motion_of(log: RobotLog, robot: RobotDescription) -> Motion:
    """The logged motion, low-pass filtered and differentiated. Raises InputError.

    Brakes and tool follow the log; without such columns the brakes are open and the tool is off.
    """
    require_rising(log)
    t = log.time - log.time[0]
    if len(t) < 20 or t[-1] < 1.0:
        raise InputError(log.path, f"has {len(t)} rows over {t[-1]:.3g} s, which is too short for a motion")
    gaps = np.diff(t)
    if gaps.max() > _LONGEST_GAP_S:
        raise InputError(log.path, f"has a gap of {gaps.max():.2f} s before data row {int(gaps.argmax()) + 2}")
    q, qd, qdd = _smooth(t, log.q)
    share = np.abs(qd).max(axis=0) / robot.speed
    if share.max() > 1.2:
        axis = int(share.argmax())
        raise InputError(
            log.path,
            f"{robot.joint[axis].name} moves at {share[axis]:.1f} times the speed limit of {robot.name}; "
            "is the time column in seconds, and the robot the right one?",
        )
    samples = len(q)
    row = np.searchsorted(t, np.arange(samples) / RATE, side="right") - 1
    signals = {name: values[row] > 0.5 for name, values in log.signals.items()}
    moving = np.abs(qd).max(axis=1) > _MOVING_RAD_S
    brake_open = signals.get("brake", np.ones(samples, bool)) | moving  # an arm cannot move against its brakes
    tool_on = signals.get("tool", np.zeros(samples, bool))
    return Motion(q, qd, qdd, brake_open, tool_on, [""], np.zeros(samples, np.int16))


def _smooth(t: Floats, q: Floats) -> tuple[Floats, Floats, Floats]:
    """q (rad), qd (rad/s) and qdd (rad/s^2), each [T, axes], at 1 kHz from samples at times `t` (s)."""
    rate = 1.0 / float(np.median(np.diff(t)))
    even = np.arange(0.0, t[-1], 1.0 / rate)
    q = np.column_stack([np.interp(even, t, column) for column in q.T])
    if rate > 2.5 * _CUTOFF_HZ:
        sections = butter(2, _CUTOFF_HZ, fs=rate, output="sos")
        q = sosfiltfilt(sections, q, axis=0, padlen=min(3 * 4, len(q) - 1))
    spline = CubicSpline(even, q, bc_type="clamped")
    samples = np.arange(0.0, even[-1], 1.0 / RATE)
    return spline(samples), spline(samples, 1), spline(samples, 2)
