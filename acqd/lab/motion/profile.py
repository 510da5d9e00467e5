"""Synchronous point-to-point motions, blended by overlap, as a KUKA controller executes them (thesis 5.3).

All axes of a motion start and stop together on one common path parameter s(t), a trapezoid of velocity
smoothed over a short time, so that acceleration is continuous. Blending starts the next motion before the
last has ended and adds their displacements. The sum may be as fast as the faster of the two motions is
allowed to be, and accelerate as both together; where it would exceed that, the next motion starts later.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from acqd.arrays import Floats

_SMOOTHING_S = 0.06
_TOLERANCE = 1e-9


@dataclass(frozen=True, slots=True)
class Profile:
    """s(t) from 0 to 1: ramp up, cruise, ramp down, averaged over the last `smoothing` seconds."""

    ramp: float
    """s."""
    cruise: float
    """s."""
    smoothing: float = _SMOOTHING_S
    """s."""

    @property
    def duration(self) -> float:
        """s."""
        return 2 * self.ramp + self.cruise + self.smoothing

    def at(self, t: Floats) -> tuple[Floats, Floats, Floats]:
        """s, ds/dt, d2s/dt2 at times `t` (s) since the start; at rest before and after."""
        t = np.clip(t, 0.0, self.duration)
        peak = 1.0 / (self.ramp + self.cruise)
        jerk = peak / (self.ramp * self.smoothing)
        corners = (0.0, self.ramp, self.ramp + self.cruise, 2 * self.ramp + self.cruise)
        s, sd, sdd = np.zeros_like(t), np.zeros_like(t), np.zeros_like(t)
        for corner, sign in zip(corners, (1, -1, -1, 1), strict=True):
            for delay, turn in ((0.0, sign), (self.smoothing, -sign)):
                since = np.maximum(t - corner - delay, 0.0)
                sdd += turn * since
                squared = since * since
                sd += turn * squared
                s += turn * squared * since
        return np.clip(s * (jerk / 6), 0.0, 1.0), sd * (jerk / 2), sdd * jerk


def fastest_profile(distance: Floats, speed: Floats, acceleration: Floats) -> Profile:
    """The shortest profile along `distance` [axes] (rad) within `speed` (rad/s) and `acceleration` (rad/s^2).

    Smoothing by a moving average exceeds neither. `distance` must not be all zero.
    """
    length = np.maximum(np.abs(distance), 1e-12)
    top_speed = float((speed / length).min())
    top_acceleration = float((acceleration / length).min())
    if top_speed**2 >= top_acceleration:
        return Profile(ramp=float(top_acceleration**-0.5), cruise=0.0)
    return Profile(ramp=top_speed / top_acceleration, cruise=1 / top_speed - top_speed / top_acceleration)


@dataclass(frozen=True, slots=True)
class Leg:
    """One motion of a blended chain."""

    start: float
    """s since the chain's begin."""
    distance: Floats
    """[axes] rad."""
    profile: Profile

    @property
    def end(self) -> float:
        """s since the chain's begin."""
        return self.start + self.profile.duration


@dataclass(frozen=True, slots=True)
class Chain:
    """Motions that follow on each other without standstill in between, or with one of zero length."""

    origin: Floats
    """[axes] rad."""
    legs: list[Leg]

    @property
    def duration(self) -> float:
        """s."""
        return max((leg.end for leg in self.legs), default=0.0)

    def sample(self, t: Floats) -> tuple[Floats, Floats, Floats]:
        """q (rad), qd (rad/s), qdd (rad/s^2), each [T, axes], at times `t` (s, rising)."""
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
    """Go to a position, as Listing 5.1 of the thesis orders it."""

    target: Floats
    """[axes] rad."""
    relative_speed: float
    """Share of each axis' speed limit."""
    relative_acceleration: float
    """Share of each axis' acceleration at 100 %."""
    blend_after: float = 1.0
    """Path parameter from which the next motion may begin; 1: not before this one has stopped."""


def plan_chain(origin: Floats, moves: list[Move], speed: Floats, acceleration: Floats) -> Chain:
    """Motions from `origin` [axes] through all `moves`; `speed` and `acceleration` are the axes' at 100 %."""
    legs: list[Leg] = []
    orders: list[Move] = []
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
            before, order = legs[-1], orders[-1]
            allowed_speed = max(order.relative_speed, move.relative_speed) * speed
            together = order.relative_acceleration + move.relative_acceleration
            allowed_acceleration = min(together, 1.0) * acceleration
            earliest = before.start + _time_of(before.profile, order.blend_after)
            alone = legs[-2].end if len(legs) > 1 else 0.0  # never three at once
            earliest = max(earliest, alone)
            start = _soonest(before, distance, profile, earliest, allowed_speed, allowed_acceleration)
            start = max(start, alone)
            legs.append(Leg(start, distance, profile))
        orders.append(move)
    return Chain(origin, legs)


def _time_of(profile: Profile, s: float) -> float:
    """Time at which the path parameter reaches `s`."""
    if s >= 1.0:
        return profile.duration
    t = np.linspace(0.0, profile.duration, 400)
    return float(np.interp(s, profile.at(t)[0], t))


def _soonest(
    before: Leg, distance: Floats, profile: Profile, earliest: float, speed: Floats, acceleration: Floats
) -> float:
    """An early start whose overlap with `before` keeps the limits."""
    if earliest >= before.end or _within(before, distance, profile, earliest, speed, acceleration):
        return min(earliest, before.end)
    # more overlap is not always worse, so candidates are tried in turn, and only the step between is bisected
    candidates = np.linspace(earliest, before.end, 24)
    for refused, start in pairwise(candidates):
        if start == before.end or _within(before, distance, profile, float(start), speed, acceleration):
            low, high = float(refused), float(start)
            for _ in range(5):
                middle = (low + high) / 2
                if _within(before, distance, profile, middle, speed, acceleration):
                    high = middle
                else:
                    low = middle
            return high
    return before.end


def _within(before: Leg, distance: Floats, profile: Profile, start: float, speed: Floats, acceleration: Floats) -> bool:
    t = _instants(before, profile, start)
    s_old, sd_old, sdd_old = before.profile.at(t - before.start)
    s_new, sd_new, sdd_new = profile.at(t - start)
    if (s_new > s_old + _TOLERANCE).any():  # else the path would leave the triangle of the three positions
        return False
    velocity = np.abs(sd_old[:, None] * before.distance + sd_new[:, None] * distance)
    change = np.abs(sdd_old[:, None] * before.distance + sdd_new[:, None] * distance)
    return bool((velocity <= speed * (1 + _TOLERANCE)).all() and (change <= acceleration * (1 + _TOLERANCE)).all())


def _instants(before: Leg, profile: Profile, start: float) -> Floats:
    """Times at which the overlap's limits are checked: all corners, and densely between them."""
    corners = [start, before.end]
    for begin, shape in ((before.start, before.profile), (start, profile)):
        edges = np.array([0.0, shape.ramp, shape.ramp + shape.cruise, 2 * shape.ramp + shape.cruise])
        corners += [*(begin + edges), *(begin + edges + shape.smoothing)]
    inside = sorted({corner for corner in corners if start <= corner <= before.end})
    return np.unique(np.concatenate([np.linspace(a, b, 12) for a, b in pairwise(inside)] or [np.array(inside)]))
