"""Garbled rows of a log: impossible time stamps, angles beyond the limits, jumps that no joint can make."""

from __future__ import annotations

import itertools

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats
from acqd.numerics import runs_of_true
from acqd.robot.description import RobotDescription

FEW = 0.01
"""Share of a log's rows that may be garbled; they are left out. With more, the log is refused."""
BEYOND = "but its limit is"
"""In the reason of every angle beyond a limit."""
_UNKNOWN = "all angles are zero here, and the arm is elsewhere within a row: angles that the driver did not know?"
_ZERO = 1e-9
"""Half an angle [rad] that is zero beside the rounding of a unit."""
_HELD = 2.0
"""Times the usual time between two poses that the arm may move before a row shows it."""
_ALLOWANCE = np.radians(2.0)  # beyond a limit
_ALLOWANCE_M = 0.02
_WHOLE_TURN = np.radians(355)  # axes with this range or more count further turns: a whole turn more is no error
_MOST_TURNS = 1000.0
_MEDIANS = 10_000  # medians at once
_STAMPS = 101  # time stamps of which a stamp must be near the median: more than are garbled together
_APART_S = 5.0
_APART_STEPS = 200
_RUN = 5  # rows with even steps: such a run is a part of the recording, wherever it lies
TOO_FAST = 3.0  # times the joint's speed limit
_RESOLUTION, _RESOLUTION_M = 0.1, 0.02  # rad and m: what is no jump at any rate
_SHORTER = 0.8
"""Way in the order of the times over that in the order of the rows, from which on rows are only out of order."""
_OFTEN = 0.02
"""Share of the steps that go back in time, from which on rows may be out of order all over."""
_SAME = 0.001  # rad between angles of the same time


def limits(robot: RobotDescription) -> Floats:
    """[axes] rad or m: the largest credible angle or travel of each axis."""
    slides = np.array([joint.slides for joint in robot.joint])
    turns = np.maximum(np.abs(robot.lower), np.abs(robot.upper)) + np.where(slides, _ALLOWANCE_M, _ALLOWANCE)
    return np.asarray(np.where((turns > _WHOLE_TURN) & ~slides, _MOST_TURNS * 2 * np.pi, turns))


def garbled_rows(time: Floats, q: Floats, robot: RobotDescription) -> dict[int, str]:
    """Rows of `time` [T] s and `q` [T, axes] rad that cannot be, each with the reason."""
    faults = _not_numbers(time, q)
    good = np.flatnonzero(np.isfinite(time) & np.isfinite(q).all(axis=1))
    for row in good[_far_from_neighbours(time[good])]:
        faults[int(row)] = f"time {time[row]:.6g} s does not belong between its neighbours"
    good = np.setdiff1d(good, list(faults))
    for row, axis in zip(*np.nonzero(np.abs(q[good]) > limits(robot)), strict=True):
        faults.setdefault(int(good[row]), beyond_limit(robot, int(axis), float(q[good[row], axis])))
    good = np.setdiff1d(good, list(faults))
    good = good[np.argsort(time[good], kind="stable")]
    for row, axis in zip(*np.nonzero(_spikes(time[good], q[good], robot)), strict=True):
        name = robot.joint[axis].name
        faults.setdefault(int(good[row]), f"{name} is at {q[good[row], axis]:.4g} rad in this row only")
    good = np.array([row for row in good if row not in faults], dtype=np.int64)
    for row in good[_unknown_poses(time[good], q[good], robot)]:
        faults[int(row)] = _UNKNOWN
    return dict(sorted(faults.items()))


def _unknown_poses(time: Floats, q: Floats, robot: RobotDescription) -> NDArray[np.bool_]:
    """[T] rows with zeros for all axes, which the arm reaches and leaves faster than it can move.

    A driver that does not know the angles writes them: before it has the angles, or when it has lost them. Poses may
    be held over many rows: the arm moves on meanwhile.
    """
    unknown = np.zeros(len(time), bool)
    # jumps by whole turns were taken out of the angles
    zero = np.asarray((np.abs(np.sin(q / 2)) < _ZERO).all(axis=1))
    if len(time) < 3 or not zero.any() or zero.all():
        return unknown
    step, changes = np.diff(time), np.flatnonzero((np.diff(q[~zero], axis=0) != 0).any(axis=1))
    usual = float(np.median(step))
    held = float(np.median(np.diff(time[~zero][changes]))) if len(changes) > 1 else usual
    way = reach(np.maximum(step, _HELD * max(held, usual)), robot)
    fast = np.asarray((np.abs(np.diff(q, axis=0)) > way).any(axis=1))
    for start, end in runs_of_true(zero):
        reached, left = start == 0 or bool(fast[start - 1]), end == len(time) or bool(fast[end - 1])
        unknown[start:end] = reached and left
    return unknown


def impossible_jump(time: Floats, q: Floats, robot: RobotDescription) -> tuple[int, str] | None:
    """The row after which a joint first is elsewhere faster than it can move, and what jumps; None without one.

    `time` [T] s rises. A pose that is written again counts once, at its first row: the arm moves on meanwhile.
    """
    new = np.flatnonzero(np.concatenate([[True], (np.diff(q, axis=0) != 0).any(axis=1)]))
    time, q = time[new], q[new]
    step = np.diff(time)
    if not len(step):
        return None
    fast = np.abs(np.diff(q, axis=0)) > reach(np.maximum(step, np.median(step)), robot)
    if not fast.any():
        return None
    row, axis = (int(index) for index in np.argwhere(fast)[0])
    joint, moved, before = robot.joint[axis], q[row + 1, axis] - q[row, axis], int(new[row + 1]) - 1
    if joint.slides:
        return before, f"{joint.name} moves {moved:+.3f} m in {step[row]:.3f} s, its limit is {joint.speed:g} m/s"
    degrees = np.degrees(moved)
    return before, f"{joint.name} turns {degrees:+.0f} deg in {step[row]:.3f} s, its limit is {joint.speed:g} deg/s"


def clock_restart(time: Floats, q: Floats) -> int | None:
    """The first row of a run whose times were there before, with other angles; None without one.

    Several recordings in one file, say: sorted by time, they would be mixed. Rows that were written twice, or out of
    order, are not: sorted by time, the arm goes a shorter way.
    """
    if len(time) < 2:
        return None
    often = (np.diff(time) < 0).mean() > _OFTEN  # recordings of one program are as short a way when they are mixed
    if often and _way(q[np.argsort(time, kind="stable")]) < _SHORTER * _way(q):
        return None
    for before, after in itertools.pairwise(_runs(time)):
        if (time[before] > time[after][0]).sum() < _RUN:
            continue  # a few rows whose stamps are late, before the next ones
        both = (time[after] > time[before][0]) & (time[after] < time[before][-1])
        again = time[after][both]
        # a block that came late fills a gap
        if len(again) and np.sum((time[before] > again[0]) & (time[before] < again[-1])) >= len(again) / 2 - 1:
            known = np.column_stack([np.interp(time[after][both], time[before], angle) for angle in q[before].T])
            if np.abs(known - q[after][both]).max() > _SAME:
                return int(after.start)
    return None


def _way(q: Floats) -> float:
    """What all joints together move over from row to row."""
    return float(np.abs(np.diff(q, axis=0)).sum())


def reach(step_s: Floats, robot: RobotDescription) -> Floats:
    """[T, axes] rad or m that joints can move within steps [T] s, with an allowance."""
    return np.asarray(TOO_FAST * step_s[:, None] * robot.speed + resolution(robot))


def resolution(robot: RobotDescription) -> Floats:
    """[axes] rad or m from one row to the next that are no jump at any rate."""
    return np.array([_RESOLUTION_M if joint.slides else _RESOLUTION for joint in robot.joint])


def _not_numbers(time: Floats, q: Floats) -> dict[int, str]:
    faults = {int(row): "time is empty or no number" for row in np.flatnonzero(~np.isfinite(time))}
    for row, axis in np.argwhere(~np.isfinite(q)):
        faults.setdefault(int(row), f"q column {axis + 1} is empty or no number")
    return faults


def _far_from_neighbours(time: Floats) -> NDArray[np.bool_]:
    """[T] True for stamps far from the median of the stamps around, and not in a run of even steps."""
    far = np.zeros(len(time), bool)
    left = np.ones(len(time), bool)
    for rows in _runs(time) if len(time) >= _RUN else ():
        left[rows] = False
    if len(time) < _RUN or not left.any():  # nearly every log: the medians are for the others
        return far
    median = _running_median(np.pad(time, _STAMPS // 2, constant_values=np.nan)[:, None], _STAMPS)[:, 0]
    usual = float(np.median(np.abs(np.diff(time))))
    return np.asarray(left & (np.abs(time - median) > max(_APART_S, _APART_STEPS * usual)))


def _runs(time: Floats) -> list[slice]:
    """Runs of rows with even steps, as they were written."""
    steps = np.diff(time)
    even = (steps > 0) & (steps < _APART_STEPS * float(np.median(np.abs(steps))))
    return [slice(first, last + 1) for first, last in runs_of_true(even) if last - first >= _RUN]


def beyond_limit(robot: RobotDescription, axis: int, angle: float) -> str:
    """That an axis reaches `angle` [rad], as a part of a sentence."""
    joint = robot.joint[axis]
    if joint.slides:
        limit = max(abs(robot.lower[axis]), abs(robot.upper[axis]))
        return f"{joint.name} reaches {abs(angle):.4g} m, {BEYOND} {limit:g} m; write metres"
    return f"{joint.name} reaches {abs(angle):.4g} rad, {BEYOND} {np.degrees(robot.upper[axis]):.0f} deg"


def _spikes(time: Floats, q: Floats, robot: RobotDescription) -> NDArray[np.bool_]:
    """[T, axes] True where an angle is farther from the median of five rows than the joint can move meanwhile.

    Or farther from both neighbours than it can move in the time between, while these are not far from one another.
    """
    if len(time) < 5:
        return np.zeros(q.shape, bool)
    step = np.diff(time)
    usual = max(float(np.median(step)), 1e-9)
    farthest = reach(np.full(1, 2 * usual), robot)
    if (2 * np.abs(np.diff(q, axis=0)) <= farthest).all():  # two rows away at most, and so from the median, too
        return np.zeros(q.shape, bool)
    median = _running_median(np.pad(q, ((2, 2), (0, 0)), mode="edge"), 5)
    fast = np.abs(np.diff(q, axis=0)) > reach(np.maximum(step, usual), robot)
    alone = np.pad(fast[:-1] & fast[1:] & (np.abs(q[2:] - q[:-2]) <= farthest), ((1, 1), (0, 0)))
    return np.asarray((np.abs(q - median) > farthest) | alone)


def _running_median(padded: Floats, count: int) -> Floats:
    """[T, k] medians of `count` rows around each row of the padded values [T + count - 1, k]; NaN do not count.

    In blocks, because a median copies every window.
    """
    windows = np.lib.stride_tricks.sliding_window_view(padded, count, axis=0)
    blocks = [np.nanmedian(windows[k : k + _MEDIANS], axis=2) for k in range(0, len(windows), _MEDIANS)]
    return np.concatenate(blocks)
