"""Chains of synchronous point-to-point motions with blending, as a KUKA controller executes them (thesis 5.3).

Blending starts a motion before the previous one has ended and adds their displacements. The sum keeps the higher of
the two speed limits and the sum of the two acceleration limits; where it would exceed them, the second motion starts
later.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from acqd.arrays import Floats
from acqd.motion.profile import Profile, fastest_profile

_TOLERANCE = 1e-9


@dataclass(frozen=True, slots=True)
class Leg:
    """One motion of a blended chain."""

    start: float
    """s since the start of the chain."""
    distance: Floats
    """[axes] rad."""
    profile: Profile

    @property
    def end(self) -> float:
        """s since the start of the chain."""
        return self.start + self.profile.duration


@dataclass(frozen=True, slots=True)
class Chain:
    """Consecutive motions without a pause between them."""

    origin: Floats
    """[axes] rad."""
    legs: list[Leg]

    @property
    def duration(self) -> float:
        """Total time (s)."""
        return max((leg.end for leg in self.legs), default=0.0)

    def active(self, time: float) -> list[int]:
        """Numbers of the motions that move the arm at `time` (s): two of them while one blends into the next."""
        return [k for k, leg in enumerate(self.legs) if leg.start <= time <= leg.end]

    def sample(self, t: Floats) -> tuple[Floats, Floats, Floats]:
        """q (rad), qd (rad/s) and qdd (rad/s^2), each [T, axes], at rising times `t` (s)."""
        q = np.tile(self.origin, (len(t), 1))
        qd, qdd = np.zeros_like(q), np.zeros_like(q)
        for leg in self.legs:
            first, last = np.searchsorted(t, (leg.start, leg.end))
            q[last:] += leg.distance
            s, sd, sdd = leg.profile.at(t[first:last] - leg.start)
            q[first:last] += s[:, None] * leg.distance
            qd[first:last] += sd[:, None] * leg.distance
            qdd[first:last] += sdd[:, None] * leg.distance
        return q, qd, qdd


@dataclass(frozen=True, slots=True)
class Move:
    """Program step: go to a position (thesis, Listing 5.1)."""

    target: Floats
    """[axes] rad."""
    relative_speed: float
    """Share of the axes' speed limits."""
    relative_acceleration: float
    """Share of the axes' accelerations at 100 %."""
    blend_after: float = 1.0
    """Path parameter from which the next motion may start; 1: after this motion has stopped."""


def plan_chain(origin: Floats, moves: list[Move], speed: Floats, acceleration: Floats) -> Chain:
    """Blended motions from `origin` [axes] through all `moves`, with the axes' `speed` and `acceleration` at 100 %."""
    legs: list[Leg] = []
    planned: list[Move] = []
    position = origin
    for move in moves:
        distance = move.target - position
        position = move.target
        if not np.abs(distance).max() > 1e-9:
            continue
        profile = fastest_profile(distance, move.relative_speed * speed, move.relative_acceleration * acceleration)
        if not legs:
            legs.append(Leg(0.0, distance, profile))
        else:
            before, move_before = legs[-1], planned[-1]
            allowed_speed = max(move_before.relative_speed, move.relative_speed) * speed
            relative_acceleration = move_before.relative_acceleration + move.relative_acceleration
            allowed_acceleration = min(relative_acceleration, 1.0) * acceleration
            last_end = legs[-2].end if len(legs) > 1 else 0.0  # at most two motions overlap
            earliest = max(before.start + _time_of(before.profile, move_before.blend_after), last_end)
            start = _blended_start(before, distance, profile, earliest, allowed_speed, allowed_acceleration)
            legs.append(Leg(max(start, last_end), distance, profile))
        planned.append(move)
    return Chain(origin, legs)


def _time_of(profile: Profile, s: float) -> float:
    """Time (s) at which the path parameter reaches `s`."""
    if s >= 1.0:
        return profile.duration
    t = np.linspace(0.0, profile.duration, 400)
    return float(np.interp(s, profile.at(t)[0], t))


def _blended_start(
    before: Leg, distance: Floats, profile: Profile, earliest: float, speed: Floats, acceleration: Floats
) -> float:
    """An early start (s) of a motion whose overlap with `before` keeps the limits."""

    def allowed(start: float) -> bool:
        return _keeps_limits(before, Leg(start, distance, profile), speed, acceleration)

    if earliest >= before.end or allowed(earliest):
        return min(earliest, before.end)
    # a longer overlap is not always worse: candidates are tried in turn, and only the last step is bisected
    candidates = np.linspace(earliest, before.end, 24)
    for refused, start in pairwise(candidates):
        if start == before.end or allowed(float(start)):
            low, high = float(refused), float(start)
            for _ in range(5):
                middle = (low + high) / 2
                if allowed(middle):
                    high = middle
                else:
                    low = middle
            return high
    return before.end


def _keeps_limits(before: Leg, leg: Leg, speed: Floats, acceleration: Floats) -> bool:
    t = _check_times(before, leg)
    s_old, sd_old, sdd_old = before.profile.at(t - before.start)
    s_new, sd_new, sdd_new = leg.profile.at(t - leg.start)
    if (s_new > s_old + _TOLERANCE).any():  # the path would leave the triangle of the three positions
        return False
    qd = np.abs(sd_old[:, None] * before.distance + sd_new[:, None] * leg.distance)
    qdd = np.abs(sdd_old[:, None] * before.distance + sdd_new[:, None] * leg.distance)
    return bool((qd <= speed * (1 + _TOLERANCE)).all() and (qdd <= acceleration * (1 + _TOLERANCE)).all())


def _check_times(before: Leg, leg: Leg) -> Floats:
    """Times (s) at which the overlap of two motions is checked: all corners of the profiles, and densely between."""
    start = leg.start
    corners = [start, before.end]
    for motion in (before, leg):
        shape = motion.profile
        edges = np.array([0.0, shape.ramp, shape.ramp + shape.cruise, 2 * shape.ramp + shape.cruise])
        corners += [*(motion.start + edges), *(motion.start + edges + shape.smoothing)]
    inside = sorted({corner for corner in corners if start <= corner <= before.end})
    return np.unique(np.concatenate([np.linspace(a, b, 12) for a, b in pairwise(inside)] or [np.array(inside)]))
