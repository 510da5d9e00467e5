"""A sequential test on a residual: CUSUM charts of its level and its variance, against a baseline of the model.

Blocks of some seconds are compared with those of the recordings that the bundle remembers (CUSUM: Page 1954). The
bounds of the charts follow from the same blocks (`bound.py`).

charts of                      see most                                      module
blocks: level, variance        what acts all the time                        blocks.py
peak at the start              a surge when the brakes open                  start_peak.py
joint torque                   mechanical changes, where torques are logged  joint_chart.py
scores of rows                 what acts in few rows                         score_charts.py
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats
from acqd.models.segments import Segment
from acqd.monitor.blocks import Blocks, Scale, blocks_of
from acqd.monitor.bound import bound
from acqd.monitor.joint_chart import JointChart
from acqd.monitor.score_charts import SCORES, ScoreCharts
from acqd.monitor.start_peak import StartPeaks, start_peak
from acqd.monitor.thresholds import MONITOR
from acqd.residual.whitening import Whitener

CHARTS = (
    "level up", "level down", "whitened variance up", "raw variance up", "peak at the start up", "joint torque up",
    *(f"{score} {side}" for score in SCORES for side in ("up", "down")),
)  # fmt: skip
_START, _JOINTS = CHARTS.index("peak at the start up"), CHARTS.index("joint torque up")
_SCORES = slice(_JOINTS + 1, len(CHARTS))
_LEAST_SPREAD = np.array([0.02, 0.05, 0.05])


@dataclass(frozen=True, slots=True)
class Baseline:
    """The residual of an unchanged robot."""

    whitener: Whitener
    scale: Scale
    """Of the three figures of blocks."""
    bounds: Floats
    """[4] of the charts of blocks."""
    start: StartPeaks | None
    """Of the peaks at the start of recordings; None where too few recordings start at rest."""
    seconds: float
    """Recorded time that it is based on."""
    joints: JointChart | None = None
    """None without logged torques."""
    scores: ScoreCharts | None = None
    """Of rows at high power, at low power, and where the tool switches."""

    @classmethod
    def of(
        cls, errors: list[Floats], predicted: list[Floats], starts_s: list[float], step_s: float, between_s: float,
        kept: Callable[[Floats], Floats] = np.asarray,
    ) -> Baseline | None:  # fmt: skip
        """From residuals and predictions [T] W of recordings; `between_s`: mean time between false alarms.

        `kept`: what is charted, [n, 3], of the blocks' figures [n, 3]. None when the recordings are too few.
        """
        whitener = Whitener.of(errors)
        in_time = sorted(zip(starts_s, range(len(errors)), strict=True))
        parts = [blocks_of(whitener, errors[k], predicted[k], start, step_s) for start, k in in_time]
        figures = kept(np.concatenate([part.figures for part in parts]))
        if len(figures) < MONITOR.cusum_fewest_blocks:
            return None
        kinds = np.concatenate([part.kinds for part in parts])
        scale = Scale.of(figures, kinds, _LEAST_SPREAD)
        z = charted(scale.standardised(figures, kinds))
        bounds = np.array([bound(column, between_s / MONITOR.cusum_block_s) for column in z.T])
        seconds = len(figures) * MONITOR.cusum_block_s
        peaks = [start_peak(errors[k], predicted[k], step_s) for _, k in in_time]
        start = StartPeaks.of([peak for peak in peaks if peak is not None], between_s / seconds)
        return cls(whitener, scale, bounds, start, seconds)

    def all_bounds(self) -> Floats:
        """[charts], infinite where there is no chart."""
        single = [np.inf if each is None else each.bound for each in (self.start, self.joints)]
        scores = np.full(2 * len(SCORES), np.inf) if self.scores is None else self.scores.bounds
        return np.concatenate([self.bounds, single, scores])

    def increments(
        self, blocks: Blocks, errors: Floats, predicted: Floats, step_s: float, logged: Segment | None
    ) -> tuple[Floats, NDArray[np.intp]]:
        """[n, charts] of the blocks of a segment, NaN where there are none, and the joints that deviate most [n]."""
        z = np.full((len(blocks.rows), len(CHARTS)), np.nan)
        joints = np.zeros(len(blocks.rows), dtype=np.intp)
        z[:, :_START] = charted(self.scale.standardised(blocks.figures, blocks.kinds))
        peak = None if self.start is None else start_peak(errors, predicted, step_s)
        if self.start is not None and peak is not None and len(z):
            z[0, _START] = self.start.charted(peak)
        if self.joints is not None and logged is not None:
            z[:, _JOINTS], joints = self.joints.charted(logged, blocks)
        if self.scores is not None and logged is not None:
            z[:, _SCORES] = self.scores.charted(logged, errors, predicted, blocks)
        return z, joints


def charted(z: Floats) -> Floats:
    """[n, 4] increments of the charts of blocks, from standardised figures [n, 3]."""
    z = np.clip(z, -MONITOR.cusum_clip, MONITOR.cusum_clip)
    return np.column_stack([z[:, 0], -z[:, 0], z[:, 1], z[:, 2]])


@dataclass(frozen=True, slots=True)
class Alarm:
    """The residual has changed."""

    chart: str
    onset_s: float
    """UTC of the block from which the values lie on a higher level: the onset estimate."""
    raised_s: float
    """UTC of the end of the block that raised the alarm."""
    height: float
    """Sum over bound."""
    joint: int | None = None
    """From 1: the joint whose torque deviates most; None for the charts of power."""

    def as_json(self) -> dict[str, Any]:
        """For MQTT and for files."""
        entry = {
            "chart": self.chart, "onset_s": self.onset_s, "raised_s": self.raised_s, "height": round(self.height, 3)
        }  # fmt: skip
        return entry if self.joint is None else entry | {"joint": self.joint}


def onset(blocks: list[tuple[float, float]]) -> float:
    """UTC of the most likely step in the values since the chart last was zero; the first block if there is no step.

    The chart may have left zero before the step, for a smaller reason.
    """
    values = np.array([value for _, value in blocks])
    count = np.arange(1, len(values))
    before, after = np.cumsum(values)[:-1] / count, np.cumsum(values[::-1])[::-1][1:] / (len(values) - count)
    apart = count * (len(values) - count) / len(values) * (after - before) ** 2  # squared error that a step takes away
    rising = np.flatnonzero(after - before > MONITOR.cusum_step)
    if not len(rising):
        return blocks[0][0]
    return blocks[int(rising[apart[rising].argmax()]) + 1][0]


@dataclass(slots=True)
class Monitor:
    """The charts; takes segments in the order of time."""

    baseline: Baseline
    sums: Floats = field(default_factory=lambda: np.zeros(len(CHARTS)))
    since: list[list[tuple[float, float]]] = field(default_factory=lambda: [[] for _ in CHARTS])
    """UTC and value of the blocks since a sum was zero, per chart."""
    judged_s: float = 0.0
    """UTC up to which rows were judged; a recording that is repeated or late is ignored."""
    alarm: Alarm | None = None
    """The first alarm; it stays until the monitor is replaced."""

    def update(
        self, errors: Floats, predicted: Floats, start_s: float, step_s: float, logged: Segment | None = None
    ) -> Alarm | None:
        """Judge a segment; return the alarm that it raises, None without a new alarm.

        `logged`: the segment itself, for its signals and joint torques.
        """
        if self.alarm is not None or start_s < self.judged_s:
            return None  # raised already, or rows that were judged before
        self.judged_s = start_s + len(errors) * step_s
        base = self.baseline
        blocks = blocks_of(base.whitener, errors, predicted, start_s, step_s)
        z, joints = base.increments(blocks, errors, predicted, step_s, logged)
        bounds = base.all_bounds()
        for number, block_s in enumerate(blocks.start_s.tolist()):
            for chart in np.flatnonzero(np.isfinite(z[number])).tolist():
                self._add(chart, block_s, float(z[number, chart]))
            highest = int(np.argmax(self.sums / bounds))
            height = float(self.sums[highest] / bounds[highest])
            if height > 1.0:
                joint = int(joints[number]) if highest == _JOINTS else None
                self.alarm = Alarm(
                    CHARTS[highest], onset(self.since[highest]), block_s + MONITOR.cusum_block_s, height, joint
                )
                return self.alarm
        return None

    def _add(self, chart: int, block_s: float, value: float) -> None:
        if self.sums[chart] == 0.0:
            self.since[chart].clear()
        self.since[chart] = [*self.since[chart][-MONITOR.cusum_remembered :], (block_s, value)]
        self.sums[chart] = max(0.0, self.sums[chart] + value - MONITOR.cusum_slack)

    def as_json(self) -> dict[str, Any]:
        """State, to continue after a restart."""
        alarm = None if self.alarm is None else self.alarm.as_json()
        return {"sums": self.sums.tolist(), "since": [list(map(list, each)) for each in self.since],
                "judged_s": self.judged_s, "alarm": alarm}  # fmt: skip

    def restore(self, state: dict[str, Any]) -> None:
        """Restore the state of `as_json`. Raises KeyError, ValueError, TypeError."""
        sums, since = list(state["sums"]), list(state["since"])
        missing = range(len(sums), len(CHARTS)) if len(sums) >= _START else ()  # charts that came later
        sums, since = [*sums, *(0.0 for _ in missing)], [*since, *([] for _ in missing)]
        self.sums = np.array(sums, dtype=float).reshape(len(CHARTS))
        self.since = [[(float(t), float(value)) for t, value in each] for each in since]
        self.judged_s = float(state["judged_s"])
        self.alarm = None if state["alarm"] is None else Alarm(**state["alarm"])
