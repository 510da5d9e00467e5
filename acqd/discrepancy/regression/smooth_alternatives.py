"""Unnamed alternatives: smooth functions of recorded quantities. If one of them explains most, the cause is unknown."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from acqd.arrays import Floats
from acqd.discrepancy.regression.torque_alternatives import LawColumns, single_laws, torque_columns, torque_groups
from acqd.models.effects.events import bins, edges, since
from acqd.models.effects.laws import POWER_LAWS
from acqd.models.effects.laws.law import Law, MotionRange
from acqd.models.effects.laws.power_laws import moving
from acqd.models.effects.scene import Scene
from acqd.models.effects.substeps import SUBSTEPS
from acqd.models.first_order import filtered

_MEMORIES_S = (3.0, 10.0, 30.0)
_LONG_MEMORIES_S = (100.0, 300.0, 1200.0)
"""Their memory lasts over the pauses between recordings."""
_AFTER_S = (0.0, 0.2, 0.5, 1.0, 2.0, 4.0, 8.0)


@dataclass(frozen=True, slots=True)
class SmoothGroup:
    """Columns that depend on one quantity."""

    name: str
    """The quantity."""
    columns: tuple[int, ...]
    law_columns: LawColumns | None = None
    """What can correct a model; None: time or a long memory, which a prediction does not know."""

    def beside(self, others: tuple[int, ...]) -> SmoothGroup:
        """With more columns."""
        return replace(self, columns=self.columns + others)


@dataclass(frozen=True, slots=True)
class Survey:
    """What ranges need of a scene; scenes themselves are too large to keep for hours of motion."""

    q: Floats
    """[n, axes] rad, once per row."""
    speed: Floats
    """[n, axes] rad/s, magnitudes."""
    load: Floats
    """[axes] Nm, the largest rigid-body torque."""
    predicted: Floats
    """[T] W."""
    drives: Floats
    """[N] W, magnitudes."""
    substep_s: float
    begin_s: float
    """UTC."""
    end_s: float

    @classmethod
    def of(cls, scene: Scene) -> Survey:
        """Of one scene."""
        return cls(
            scene.q[::SUBSTEPS].copy(), np.abs(scene.qd[::SUBSTEPS]), np.abs(scene.tau_rigid).max(axis=0),
            scene.predicted, np.abs(scene.drives), scene.substep_s, float(scene.t[0]), float(scene.t[-1]),
        )  # fmt: skip


@dataclass(frozen=True, slots=True)
class Ranges:
    """Ranges that the recordings cover."""

    motion: MotionRange
    calendar_s: dict[bool, tuple[float, float]]
    """UTC of the start and the end of the recordings in question (True) and of the reference (False).

    Slow time is scaled to the recordings of one side: months between the sides must not change a verdict.
    """
    before: dict[tuple[bool, float, float], float]
    """By side, start of a recording (UTC, s) and memory (s): W that the recordings before have left."""

    @classmethod
    def of(cls, surveys: Sequence[Survey], in_question: Sequence[bool]) -> Ranges:
        """Ranges of all recordings."""
        q = np.concatenate([each.q for each in surveys])
        speed = np.concatenate([each.speed for each in surveys])
        sides = {
            side: [each for each, own in zip(surveys, in_question, strict=True) if own == side]
            for side in set(in_question)
        }
        motion = MotionRange(
            q.min(axis=0), q.max(axis=0), np.maximum(np.percentile(speed, 99.5, axis=0), 1e-3),
            np.maximum(np.max([each.load for each in surveys], axis=0), 1e-6),
            np.percentile(np.concatenate([each.predicted for each in surveys]), [50, 75, 90, 97]),
        )  # fmt: skip
        return cls(
            motion,
            {side: (min(s.begin_s for s in own), max(s.end_s for s in own)) for side, own in sides.items()},
            {(side, *key): left for side, own in sides.items() for key, left in _left_before(own).items()},
        )  # fmt: skip


def smooth_columns(scene: Scene, ranges: Ranges, *, in_question: bool) -> list[Floats]:
    """Columns [N] at substeps, in the order of `alternatives`."""
    columns = [
        column for law in POWER_LAWS for joint in law.joints(scene.axes)
        for column in law.at(scene, law.shape_of(ranges.motion, joint)).T
    ]  # fmt: skip
    columns += [np.ones(len(scene.q))]
    columns += [_remembered(np.abs(scene.drives), scene.substep_s, seconds, 0.0) for seconds in _MEMORIES_S]
    starts, stops = edges(moving(scene), scene, "moving")
    columns += list(bins(since(starts, scene, "start_age"), _AFTER_S).T)
    columns += list(bins(since(stops, scene, "stop_age"), _AFTER_S).T)
    into = (scene.t - scene.t[0]) / 60.0
    columns += [into, np.exp(-into * 6)]
    begin_s, end_s = ranges.calendar_s[in_question]
    for seconds in _LONG_MEMORIES_S:
        before = ranges.before[in_question, float(scene.t[0]), seconds]
        columns.append(_remembered(np.abs(scene.drives), scene.substep_s, seconds, before))
    share_of_time = (scene.t - begin_s) / max(end_s - begin_s, 1.0)
    columns += list(np.cos(np.pi * np.outer(share_of_time, np.arange(1, 5))).T)
    return columns + torque_columns(scene, ranges.motion)


def alternatives(axes: int) -> Iterator[SmoothGroup]:
    """Groups of columns, in the order of `smooth_columns`."""
    place = 0

    def take(name: str, count: int) -> SmoothGroup:
        nonlocal place
        place += count
        return SmoothGroup(name, tuple(range(place - count, place)))

    def whole(law: Law, joint: int) -> SmoothGroup:
        group = LawColumns.whole(law, joint, axes)
        return replace(take(law.label(joint), len(group.columns)), law_columns=group)

    yield from (whole(law, joint) for law in POWER_LAWS for joint in law.joints(axes))
    level, place = (place,), place + 1  # what follows the past at a distance looks like an offset
    for seconds in _MEMORIES_S:
        yield take(f"the drives' power of the last {seconds:g} s", 1).beside(level)
    yield take("the time since the motion started", len(_AFTER_S) - 1)
    yield take("the time since the motion stopped", len(_AFTER_S) - 1)
    yield take("the time within the recording", 2)
    for seconds in _LONG_MEMORIES_S:
        yield take(f"the drives' power of the last {seconds / 60:.2g} min, pauses counted", 1).beside(level)
    yield take("the time of day", 4)
    first: dict[tuple[str, int], int] = {}
    for group in torque_groups(axes):
        first[group.law.id, group.joint] = place
        yield whole(group.law, group.joint)
    for name, single in single_laws(axes):
        start = first[single.law.id, single.joint]
        yield SmoothGroup(name, tuple(start + column for column in single.columns), single)


def _left_before(side: list[Survey]) -> dict[tuple[float, float], float]:
    """The state of every long memory (s) at the start (UTC, s) of every recording of a side; the first starts cold.

    A pause counts as rest. The state of a side does not depend on the other side, which may be months away.
    """
    left: dict[tuple[float, float], float] = {}
    for seconds in _LONG_MEMORIES_S:
        state, end_s = 0.0, -np.inf
        for each in sorted(side, key=lambda survey: survey.begin_s):
            state *= float(np.exp(-max(each.begin_s - end_s, 0.0) / seconds))
            left[each.begin_s, seconds] = state
            state = float(_remembered(each.drives, each.substep_s, seconds, state)[-1])
            end_s = each.end_s
    return left


def _remembered(values: Floats, step_s: float, seconds: float, before: float) -> Floats:
    """`values` [N] behind a first-order low-pass that starts at `before`."""
    keep = float(np.exp(-step_s / seconds))
    return filtered((1 - keep, 0.0), -keep, values, np.array([keep * before]))[0]
