"""White rows of joint torques: runs of motion, their noise model, and sums of products per session."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats
from acqd.dataset.split import log_name
from acqd.discrepancy.joints.columns import BaseLayout, base_columns, measured_torque
from acqd.discrepancy.joints.sessions import Products, Session
from acqd.discrepancy.thresholds import THRESHOLDS
from acqd.models.effects.scene import Scene
from acqd.models.effects.substeps import averaged
from acqd.models.greybox.model import GreyBox
from acqd.models.segments import Segment
from acqd.numerics import runs_of_true
from acqd.residual.known_rows import known_rows
from acqd.residual.logged_torque import has_torque, side_of
from acqd.residual.thresholds import NOISE
from acqd.residual.whitening import Whitener
from acqd.robot.description import RobotDescription

_ANY_SIZE = 1e3
"""Prior deviation of a selected effect's parameters: wide enough to be free."""


def session_key(recording: str, *, in_question: bool) -> str:
    """Name of a session: a log of one side, because recorders use the same names again.

    Friction and zeros are the same in all pieces of a log.
    """
    return f"{'new' if in_question else 'reference'} {log_name(recording)}"


def runs_of_motion(speed: Floats, inside: slice, *, all_rows: bool) -> list[tuple[int, int]]:
    """First row, and the row after the last, of runs of motion `inside` known rows; `speed` [T] rad/s of the joint.

    A joint at rest sticks: its motor may carry any torque up to the breakaway torque, so that only moving rows say
    something about the load (`all_rows`: a sensor behind the gear has no such rows). A run is longer than the memory
    of the noise.
    """
    known = np.ones(len(speed), dtype=bool) if all_rows else np.abs(speed) > NOISE.stick_rad_s
    known[: inside.start] = False
    known[inside.stop :] = False
    return [(first, last) for first, last in runs_of_true(known) if last - first > THRESHOLDS.joint_noise_order]


@dataclass(frozen=True, slots=True)
class JointRows:
    """One joint in one segment."""

    session: str
    in_question: bool
    segment: int
    joint: int
    runs: list[tuple[int, int]]
    base: NDArray[np.float32]
    """[rows of all runs, b], not white."""
    torque: Floats
    """[rows of all runs] Nm."""

    def of_runs(self, values: Floats) -> Floats:
        """Rows of all runs from rows [T, ...] of the segment."""
        return np.concatenate([values[first:last] for first, last in self.runs])

    def split(self, values: NDArray[Any]) -> list[NDArray[Any]]:
        """Values [rows of all runs, ...] per run."""
        lengths = np.cumsum([last - first for first, last in self.runs])[:-1]
        return list(np.split(values, lengths))

    def white(self, whitener: Whitener, values: NDArray[Any]) -> Floats:
        """White rows; every run starts without a past."""
        return np.concatenate([whitener.from_start(run) for run in self.split(values)])


@dataclass(frozen=True, slots=True)
class Observed:
    """Joint torques of all drawn segments, with the base model of the reference and a noise model per joint."""

    layout: BaseLayout
    rows: list[JointRows]
    white: list[tuple[NDArray[np.float32], Floats]]
    """Base columns and residual, white, of every element of `rows`."""
    scenes: dict[int, Scene]
    """By number of the segment."""
    noise: dict[int, Whitener]
    """By joint."""
    mean: Floats
    """[b] prior of the base model."""
    deviation: Floats
    beta: Floats
    """[b] base model of the reference."""
    ratio: float
    """Logged torques relative to the model's torques: a drive gain or the supply's gain may be off by some percent."""

    @classmethod
    def of(
        cls, model: GreyBox, robot: RobotDescription, segments: list[tuple[Segment, bool]], scenes: Sequence[Scene]
    ) -> Observed | None:
        """`segments` with whether they are in question, and their scenes.

        None without torques on both sides, or with prismatic joints.
        """
        side = side_of([segment for segment, _ in segments])
        if side is None or robot.sliding:  # forces and torques have no common thresholds
            return None
        usable = [number for number, (segment, _) in enumerate(segments) if has_torque(segment, side)]
        layout = BaseLayout(model.axes, side)
        drawn = {number: scenes[number] for number in _drawn(segments, usable, model.step_s)}
        rows: list[JointRows] = []
        for number, scene in drawn.items():
            segment, in_question = segments[number]
            X = base_columns(scene, layout, model.group("inertial"))
            torque = measured_torque(segment, side, robot)
            speed = averaged(scene.qd)
            for joint in range(model.axes):
                runs = runs_of_motion(speed[:, joint], known_rows(segment), all_rows=side == "link")
                if runs:
                    session = session_key(segment.recording, in_question=in_question)
                    chosen = np.concatenate([np.arange(first, last) for first, last in runs])
                    own = X[chosen, joint].astype(np.float32), torque[chosen, joint]
                    rows.append(JointRows(session, in_question, number, joint, runs, *own))
        rows = _comparable(rows, model.axes)
        before = [each for each in rows if not each.in_question]
        if not before or len(before) == len(rows):
            return None
        mean, deviation = layout.prior(robot)
        beta = _base_fit(before, mean, deviation, None)
        for _ in range(2):
            noise = _noise_models(before, beta)
            beta = _base_fit(before, mean, deviation, noise)
        white = [
            (
                each.white(noise[each.joint], each.base).astype(np.float32),
                each.white(noise[each.joint], each.torque - each.base @ beta),
            )
            for each in rows
        ]
        return cls(layout, rows, white, drawn, noise, mean, deviation, beta, _ratio(model, before, layout, beta))

    def with_base_columns(self, columns: dict[int, Floats]) -> Observed:
        """With more base columns [T, axes, k] Nm per segment: free in every session in question, else 0.

        A body may have been mounted another way round between two sessions.
        """
        rows, white = [], []
        names = sorted({each.session for each in self.rows if each.in_question})
        for each, (X, y) in zip(self.rows, self.white, strict=True):
            own = each.of_runs(columns[each.segment][:, each.joint])
            more = np.column_stack([own * (each.in_question and each.session == name) for name in names])
            white_more = each.white(self.noise[each.joint], more)
            rows.append(replace(each, base=np.column_stack([each.base, more]).astype(np.float32)))
            white.append((np.column_stack([X, white_more]).astype(np.float32), y))
        count = next(iter(columns.values())).shape[2] * len(names)
        wide = np.full(count, _ANY_SIZE)
        return replace(
            self, rows=rows, white=white, mean=np.append(self.mean, np.zeros(count)),
            deviation=np.append(self.deviation, wide), beta=np.append(self.beta, np.zeros(count)),
        )  # fmt: skip

    def session(self, name: str) -> Session:
        """Sums over the session's rows."""
        base, residual = np.zeros((len(self.beta), len(self.beta))), np.zeros(len(self.beta))
        in_question = False
        for each, (X, y) in zip(self.rows, self.white, strict=True):
            if each.session == name:
                exact = X.astype(np.float64)
                base += exact.T @ exact
                residual += exact.T @ y
                in_question = each.in_question
        return Session(name, in_question, base, residual)

    def products(self, columns: dict[int, Floats]) -> dict[str, Products]:
        """Per session, of columns [T, axes, k] Nm per segment."""
        sums: dict[str, Products] = {}
        for each, (X, y) in zip(self.rows, self.white, strict=True):
            C = each.white(self.noise[each.joint], each.of_runs(columns[each.segment][:, each.joint]))
            own = Products(C.T @ C, C.T @ X, C.T @ y)
            sums[each.session] = sums[each.session] + own if each.session in sums else own
        return sums


def _comparable(rows: list[JointRows], axes: int) -> list[JointRows]:
    """Without joints that hardly move in the reference: their noise is unknown."""
    count = np.zeros(axes)
    for each in rows:
        count[each.joint] += 0 if each.in_question else len(each.torque)
    enough = count >= THRESHOLDS.joint_rows_per_order * THRESHOLDS.joint_noise_order
    return [each for each in rows if enough[each.joint]]


def _drawn(segments: list[tuple[Segment, bool]], usable: list[int], step_s: float) -> list[int]:
    """Numbers of usable segments, evenly over each side, of about `joint_longest_s` at most."""
    drawn: list[int] = []
    for side in (False, True):
        numbers = [number for number in usable if segments[number][1] == side]
        seconds = sum(len(segments[number][0].P) for number in numbers) * step_s
        every = max(1, math.ceil(seconds / THRESHOLDS.joint_longest_s))
        drawn += numbers[::every]
    return sorted(drawn)


def _ratio(model: GreyBox, rows: list[JointRows], layout: BaseLayout, beta: Floats) -> float:
    """Slope of the rigid-body torque of `beta` on that of the grey box, over all joints."""
    inertial = layout.part("inertial")
    logged = np.concatenate([each.base[:, inertial] @ beta[inertial] for each in rows])
    modelled = np.concatenate([each.base[:, inertial] @ model.group("inertial") for each in rows])
    return float(logged @ modelled / max(float(modelled @ modelled), 1e-9))


def _base_fit(rows: list[JointRows], mean: Floats, deviation: Floats, noise: dict[int, Whitener] | None) -> Floats:
    """[b] parameters of the base model with a normal prior; `noise` by joint, None for rows of unit variance."""
    A, b = np.diag(deviation**-2.0), mean * deviation**-2.0
    for each in rows:
        values = np.column_stack([each.base, each.torque])
        values = values if noise is None else each.white(noise[each.joint], values)
        A += values[:, :-1].T @ values[:, :-1]
        b += values[:, :-1].T @ values[:, -1]
    return np.asarray(np.linalg.solve(A, b))


def _noise_models(rows: list[JointRows], beta: Floats) -> dict[int, Whitener]:
    """By joint, from the residuals of parameters `beta` [b]."""
    left: dict[int, list[Floats]] = {}
    for each in rows:
        left.setdefault(each.joint, []).extend(each.split(each.torque - each.base @ beta))
    order = THRESHOLDS.joint_noise_order
    return {joint: Whitener.of(runs, order, known_level=True) for joint, runs in left.items()}
