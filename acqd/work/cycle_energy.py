"""Energy of every cycle, its spread, outliers with their cause, and what lies between the cycles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.stats import spearmanr

from acqd.arrays import Floats
from acqd.models.segments import Segment
from acqd.models.yearly import moving_rows
from acqd.numerics import mad_sigma
from acqd.work.cycles import Found, cycles_of, same_path

_J_PER_KWH = 3.6e6
_FEWEST = 8
"""Cycles, for outliers."""
_OUTLIER = 3.5
"""Robust standard deviations (Iglewicz and Hoaglin 1993)."""
_LEAST_SHARE = 0.02
"""Of the median energy: less is not worth a word."""
_LEAST_REST_S = 0.1
_WARMER, _CHANCE = -0.5, 0.01
"""Rank correlation of the power in motion with the number of the cycle, and its p-value, while a robot warms up."""

Cause = Literal["", "waiting", "slow", "warm-up", "more power", "shorter wait", "fast", "less power"]
Where = Literal["other motion", "idle", "standby"]


@dataclass(frozen=True, slots=True)
class Cycle:
    """One cycle."""

    recording: str
    start_s: float
    """Unix time."""
    seconds: float
    moving_s: float
    kWh: float
    """Measured."""
    moving_kWh: float
    """Of the rows in motion."""
    kind: int
    """From 1: cycles of one kind take the same path."""
    outlier: Cause = ""
    """Why the cycle took so much more or less than the others of its kind; empty for the usual ones."""

    @property
    def rest_s(self) -> float:
        """Time at rest."""
        return self.seconds - self.moving_s

    @property
    def moving_power(self) -> float:
        """Mean power in motion, W."""
        return self.moving_kWh * _J_PER_KWH / max(self.moving_s, 1e-9)

    @property
    def resting_power(self) -> float | None:
        """Mean power at rest, W; None without rest."""
        if self.rest_s < _LEAST_REST_S:
            return None
        return (self.kWh - self.moving_kWh) * _J_PER_KWH / self.rest_s


@dataclass(frozen=True, slots=True)
class Between:
    """Time and energy outside of cycles."""

    name: Where
    """Motion that is no cycle; rest; rest with closed brakes, where the log has them."""
    seconds: float
    kWh: float


@dataclass(frozen=True, slots=True)
class CycleEnergy:
    """Cycles of all recordings and the rest: together all measured energy."""

    cycles: list[Cycle]
    """In the order of time."""
    between: list[Between]
    kWh: float
    seconds: float


def cycle_energy(segments: Sequence[Segment], step_s: float) -> CycleEnergy:
    """Find cycles in every segment, and sum the measured power over them."""
    found = [cycles_of(segment.q, step_s) for segment in segments]
    cycles: list[Cycle] = []
    between: dict[Where, Floats] = {"other motion": np.zeros(2), "idle": np.zeros(2), "standby": np.zeros(2)}
    for segment, each, kind in zip(segments, found, _kinds(found), strict=True):
        moving = moving_rows(segment, step_s)
        cycles += _cycles(segment, each, kind, moving, step_s)
        for name, share in _outside(segment, each, moving).items():
            between[name] += share.sum() * step_s, share @ segment.P * step_s / _J_PER_KWH
    judged = [
        cycle for kind in sorted({c.kind for c in cycles}) for cycle in _judged([c for c in cycles if c.kind == kind])
    ]
    rest = [Between(name, *each.tolist()) for name, each in between.items() if each[0] > 0]
    P = np.concatenate([segment.P for segment in segments])
    in_time = sorted(judged, key=lambda each: each.start_s)
    return CycleEnergy(in_time, rest, float(P.sum()) * step_s / _J_PER_KWH, len(P) * step_s)


def _kinds(found: Sequence[Found]) -> list[int]:
    """Number of the path of every recording with cycles; 0 for those without."""
    first: list[Found] = []
    kinds = []
    for each in found:
        if not len(each.begin):
            kinds.append(0)
            continue
        number = next((k for k, other in enumerate(first) if same_path(each, other)), len(first))
        if number == len(first):
            first.append(each)
        kinds.append(number + 1)
    return kinds


def _cycles(segment: Segment, found: Found, kind: int, moving: np.ndarray, step_s: float) -> list[Cycle]:
    """Sums between fractions of rows: row k lasts from k - 1/2 to k + 1/2."""
    edges = np.arange(len(segment.P) + 1) - 0.5

    def between(values: Floats) -> list[float]:
        summed = np.concatenate([[0.0], np.cumsum(values)]) * step_s
        return (np.interp(found.end, edges, summed) - np.interp(found.begin, edges, summed)).tolist()  # type: ignore[no-any-return]

    moving_s = between(moving * 1.0)
    energy, moving_energy = between(segment.P / _J_PER_KWH), between(moving * segment.P / _J_PER_KWH)
    return [
        Cycle(segment.recording, segment.start_s + begin * step_s, (end - begin) * step_s, *sums, kind)
        for begin, end, sums in zip(
            found.begin.tolist(), found.end.tolist(), zip(moving_s, energy, moving_energy, strict=True), strict=True
        )
    ]


def _outside(segment: Segment, found: Found, moving: np.ndarray) -> dict[Where, Floats]:
    """[T] share of every row outside of cycles, by what the robot does there."""
    edges = np.arange(len(segment.P) + 1) - 0.5
    inside = np.zeros(len(segment.P))
    for begin, end in zip(found.begin, found.end, strict=True):
        inside += np.clip(np.minimum(edges[1:], end) - np.maximum(edges[:-1], begin), 0.0, 1.0)
    outside = 1.0 - inside
    closed = segment.signals["brake"] < 0.5 if "brake" in segment.signals else np.zeros(len(moving), dtype=bool)
    return {
        "other motion": outside * moving, "idle": outside * (~moving & ~closed), "standby": outside * (~moving & closed)
    }  # fmt: skip


def _judged(cycles: list[Cycle]) -> list[Cycle]:
    """Cycles of one kind with the causes of outliers."""
    if len(cycles) < _FEWEST:
        return cycles
    energy = np.array([each.kWh for each in cycles])
    middle = float(np.median(energy))
    least = max(_OUTLIER * mad_sigma(energy), _LEAST_SHARE * abs(middle))
    usual, cold = _Usual.of(cycles), _cold(cycles)
    return [
        replace(each, outlier=usual.cause(each, cold=(each.recording, each.start_s) in cold))
        if abs(each.kWh - middle) > least
        else each
        for each in cycles
    ]


@dataclass(frozen=True, slots=True)
class _Usual:
    """Medians of a kind of cycle."""

    rest_s: float
    moving_s: float
    resting_power: float
    moving_power: float

    @classmethod
    def of(cls, cycles: Sequence[Cycle]) -> _Usual:
        resting = [power for each in cycles if (power := each.resting_power) is not None]
        return cls(
            float(np.median([each.rest_s for each in cycles])), float(np.median([each.moving_s for each in cycles])),
            float(np.median(resting)) if resting else 0.0, float(np.median([each.moving_power for each in cycles])),
        )  # fmt: skip

    def cause(self, cycle: Cycle, *, cold: bool) -> Cause:
        """The largest of three parts of the difference from the usual energy: rest, time in motion, power in motion."""
        resting = self.resting_power if cycle.resting_power is None else cycle.resting_power
        rest = (cycle.rest_s - self.rest_s) * resting
        slow = (cycle.moving_s - self.moving_s) * self.moving_power
        power = cycle.moving_s * (cycle.moving_power - self.moving_power)
        if rest + slow + power > 0:
            names: tuple[Cause, Cause, Cause] = "waiting", "slow", "warm-up" if cold else "more power"
            return names[int(np.argmax([rest, slow, power]))]
        names = "shorter wait", "fast", "less power"
        return names[int(np.argmin([rest, slow, power]))]


def _cold(cycles: Sequence[Cycle]) -> set[tuple[str, float]]:
    """Recording and start of the cycles in the first half of recordings in which the power in motion falls."""
    cold: set[tuple[str, float]] = set()
    for name in {each.recording for each in cycles}:
        mine = [each for each in cycles if each.recording == name]
        if len(mine) < _FEWEST:
            continue
        correlation, p = spearmanr(np.arange(len(mine)), [each.moving_power for each in mine])
        if correlation < _WARMER and p < _CHANCE:
            cold |= {(name, each.start_s) for each in mine[: len(mine) // 2]}
    return cold
