"""Whether the other columns of a log are measurements that fit its angles.

What a driver does not measure it publishes all the same: zeros, one number, the last value again. A moving arm has no
such torques, currents or speeds, so that they count as not measured. Quantities that are measured, in another unit or
of another sign than the angles say, are left out with the reason.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats
from acqd.robot.description import RobotDescription

TITLES = {"qd": "speed", "tau": "torque", "current": "current", "temperature": "temperature"}
"""Quantities of single joints, as a user calls them."""
MOVED = 0.05
"""rad or m that a joint covers at least in a log in which its speed, torque and current cannot stay zero."""
_ZERO = 1e-6
"""Nm, N, A or rad/s: numbers so small are those of a driver's arithmetic."""
_MANY_ROWS = 200
"""Rows over which no measured torque or current of a moving joint has one value only."""
_SLOWEST = 0.05
"""rad/s or m/s of a joint whose slope tells its speed."""
_FEWEST = 100
_DEGREES = 0.02
"""Difference of the ratio of speeds to slopes from that of radians to degrees, over it, by which angles are known."""
_SPEED = (0.7, 1.4)
"""Speed over the slope of the angle: filters of the controller and the rows between change it by less."""
_KELVIN = 200.0
"""degC that no joint reaches."""
_COLDEST = -60.0
"""degC below which no robot works."""
_OTHER_MOTION = 0.5
"""Change of a joint's speed, over its usual size, since the values were last refreshed: torques must have changed."""
_STEPS = 2.5
"""Steps of the written values, beyond which a change is no rounding."""
_SOME, _SOME_ROWS, _MANY_OLD = 0.005, 5, 0.1
"""Share of the rows in motion with one number for all joints, and their number, from which on a quantity counts as not
measured; and share of those with values that are too old, which are wrong by less."""


@dataclass(frozen=True, slots=True)
class Judged:
    """What is wrong with the quantities of a log."""

    unmeasured: dict[str, str] = field(default_factory=dict)
    """Quantity -> whose values never change: "the torque of elbow"."""
    unusable: dict[str, str] = field(default_factory=dict)
    """Quantity -> why it cannot be used."""

    @property
    def gone(self) -> set[str]:
        """Quantities that count as not measured."""
        return self.unmeasured.keys() | self.unusable.keys()


def judged(time: Floats, q: Floats, values: dict[str, Floats], robot: RobotDescription) -> Judged:
    """What is wrong with quantities `qd`, `tau`, `current`, `temperature` [T, axes] at rising times [T] s.

    `q` [T, axes]: the angles of the same rows.
    """
    unmeasured, unusable = {}, {}
    moves = np.ptp(q, axis=0) > MOVED if len(q) else np.zeros(robot.axes, bool)
    for name, of_joints in values.items():
        constant = stuck(name, of_joints, moves) if len(of_joints) else np.zeros(len(moves), bool)
        if constant.any():
            which = "every joint" if constant.all() else robot.joint[int(constant.argmax())].name
            unmeasured[name] = f"the {TITLES[name]} of {which}"
            continue
        empty = ~np.isfinite(of_joints).any(axis=0)
        if len(of_joints) and empty.any():
            fault = f"the {TITLES[name]} of {robot.joint[int(empty.argmax())].name} has no number in any row"
        elif name == "temperature":
            fault = temperature_fault(of_joints)
        elif outages := _outages(time, q, of_joints, moves):
            fault = f"the {TITLES[name]} {outages}"
        else:
            fault = speed_fault(time, q, of_joints, robot) if name == "qd" else ""
        if fault:
            unusable[name] = fault
    return Judged(unmeasured, unusable)


def at_zero(q: Floats, robot: RobotDescription) -> tuple[str, ...]:
    """Joints whose angle of angles [T, axes] is 0 in every row while others move: at rest there, or not measured."""
    if not len(q) or not (np.ptp(q, axis=0) > MOVED).any():
        return ()
    return tuple(robot.joint[axis].name for axis in np.flatnonzero((q == 0.0).all(axis=0)))


def stuck(name: str, values: Floats, moves: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """[axes] whether the column of a joint that moves, of columns [T, axes], holds zeros only, or one number too often.

    A temperature may be constant, and a joint may be at 0 degC, but not all joints.
    """
    if name == "temperature":
        return np.full(len(moves), bool((values == 0.0).all() or (values == -1.0).all()))
    often = len(values) >= _MANY_ROWS
    zero = np.abs(values).max(axis=0) < _ZERO
    return np.asarray(moves & (zero | (often & (np.ptp(values, axis=0) == 0.0))))


def _outages(time: Floats, q: Floats, values: Floats, moves: NDArray[np.bool_]) -> str:
    """Which rows in motion hold values [T, axes] that were not measured; empty with few of them.

    In such rows a joint moves for two rows before and after: values may be older or younger than their angles by a row.
    """
    if len(time) < _MANY_ROWS or not moves.any() or not np.isfinite(values).all():
        return ""
    slope = np.diff(q[:, moves], axis=0) / np.diff(time)[:, None]
    usual = np.sqrt((slope**2).mean(axis=0))
    around = np.lib.stride_tricks.sliding_window_view(np.pad(slope, ((2, 2), (0, 0))), 4, axis=0)  # [T, moving axes, 4]
    least, most = around.min(axis=2), around.max(axis=2)
    moving = ((least > usual / 2) | (most < -usual / 2)).any(axis=1)
    written = np.array([np.diff(np.unique(column)).min(initial=np.inf) for column in values.T])
    if count := _with_one_number(values, moving, _STEPS * written):
        return f"is one number for all joints in {count} of {moving.sum()} rows in motion, and another beside them"
    rows = np.arange(len(time))
    changes = np.concatenate([[True], (np.diff(values, axis=0) != 0).any(axis=1)])
    since = np.maximum.accumulate(np.where(changes, rows, 0))
    jump = np.concatenate([[False], (np.abs(np.diff(values, axis=0)) > _STEPS * written).any(axis=1)])
    ends = np.append(np.flatnonzero(changes), len(time))
    next_row = ends[np.searchsorted(ends, rows, side="right")]
    refreshed = np.append(jump, True)[next_row]  # by more than rounding hides; at the end of the log nobody knows
    apart = np.maximum(least - most[since], least[since] - most)
    old = moving & ~changes & refreshed & (apart > _OTHER_MOTION * usual).any(axis=1)
    if old.sum() <= max(_MANY_OLD * moving.sum(), _SOME_ROWS):
        return ""
    return (
        f"stays as it was in {old.sum()} of {moving.sum()} rows in motion while that changes, for up to "
        f"{float((time - time[since])[old].max()):.2g} s"
    )


def _with_one_number(values: Floats, moving: NDArray[np.bool_], rounding: Floats) -> int:
    """Rows in motion that hold one number for all joints and are far from the rows beside them; 0 with few of them."""
    one_number = np.ptp(values, axis=1) == 0.0 if values.shape[1] > 1 else np.abs(values[:, 0]) < _ZERO
    rows, other = np.flatnonzero(one_number & moving), np.flatnonzero(~one_number)
    if not len(rows) or len(other) < 2:
        return 0
    size = float(np.median(np.linalg.norm(values[other], axis=1)))
    at = np.clip(np.searchsorted(other, rows), 1, len(other) - 1)
    far = np.ones(len(rows), bool)
    for beside in (other[at - 1], other[at]):
        change = values[beside] - values[rows]
        far &= (np.linalg.norm(change, axis=1) > size / 2) & (np.abs(change) > rounding).any(axis=1)
    count = int(far.sum())
    return count if count > max(_SOME * moving.sum(), _SOME_ROWS) else 0


def speed_fault(time: Floats, q: Floats, qd: Floats, robot: RobotDescription) -> str:
    """Why speeds [T, axes] are not those of the angles at rising times [T] s; empty if they are, or nothing moves."""
    for axis, ratio in _speed_ratios(time, q, qd).items():
        if not _SPEED[0] < ratio < _SPEED[1]:
            unit = ", in deg/s?" if 40 < ratio < 80 else ", of another sign?" if -1.4 < ratio < -0.7 else ""
            return f"the speed of {robot.joint[axis].name} is {ratio:.3g} times the slope of its angle{unit}"
    return ""


def angle_fault(time: Floats, q: Floats, qd: Floats, robot: RobotDescription) -> str:
    """Why angles are in degrees, by speeds in rad/s that fit them; empty otherwise. Arguments as of `speed_fault`."""
    turning = [r for axis, r in _speed_ratios(time, q, qd).items() if not robot.joint[axis].slides]
    if not turning or any(abs(np.degrees(ratio) - 1) > _DEGREES for ratio in turning):
        return ""
    return "its speeds are pi/180 times the slopes of its angles: the angles are in degrees; write radians"


def _speed_ratios(time: Floats, q: Floats, qd: Floats) -> dict[int, float]:
    """Speed over slope of the angle, of the axes that move."""
    if len(time) < _FEWEST:
        return {}
    slope = (q[2:] - q[:-2]) / (time[2:] - time[:-2])[:, None]
    ratios = {}
    for axis in range(q.shape[1]):
        seen = qd[1:-1, axis]
        moves = (np.abs(slope[:, axis]) > _SLOWEST) & np.isfinite(seen)
        if moves.sum() >= _FEWEST:
            ratios[axis] = float(np.median(seen[moves] / slope[moves, axis]))
    return ratios


def temperature_fault(values: Floats) -> str:
    """Why temperatures [T, axes] are not in degC; empty if they may be."""
    known = values[np.isfinite(values)]
    usual = float(np.median(known)) if len(known) else 0.0
    if usual > _KELVIN:
        return f"temperatures of {usual:.0f} are not degC: in K?"
    return f"temperatures of {usual:.0f} degC are below those in which a robot works" if usual < _COLDEST else ""


def on_off(values: Floats) -> Floats | None:
    """A signal [T] as 0 and 1, from any two levels of which one is 0, or -1; None for other values, and without any.

    Values between 0 and 1 (resampled ones) and NaN stay.
    """
    known = np.unique(values[np.isfinite(values)])
    if not len(known):
        return None
    if known[0] >= 0.0 and known[-1] <= 1.0:
        return values
    if len(known) > 2 or (known[0] < 0.0 and len(known) == 1) or (len(known) == 2 and not {0.0, -1.0} & {*known}):
        return None
    on = float(known[np.abs(known).argmax()]) if 0.0 in known or len(known) == 1 else float(known[-1])
    return np.where(np.isfinite(values), (values == on).astype(np.float64), np.nan)
