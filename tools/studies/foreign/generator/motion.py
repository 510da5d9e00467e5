"""Motion of a session: recordings with point-to-point moves, single-joint moves, multisines and pauses, then rest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from tools.studies.foreign.generator.arm import Arm, Floats

STEP_S = 0.005
"""Step of the simulation."""
GAP_S = 12.0
"""Rest between recordings."""
_REST_S = 3.0
"""Rest at both ends of a recording, with closed brakes during the outer half."""
_REACH_RAD = 2.2
"""Largest angle from the middle of its range that a joint turns."""


@dataclass(frozen=True, slots=True)
class Plan:
    """How much is recorded."""

    recordings: int
    seconds: float
    """Duration of each recording."""
    override: tuple[float, float] = (0.2, 1.0)
    """Speeds of moves, as shares of the joints' speeds."""


@dataclass(frozen=True, slots=True)
class Motion:
    """Motion of a whole session at T rows, STEP_S apart."""

    t: Floats
    """[T] s since the session's start."""
    q: Floats
    """[T, n] rad."""
    qd: Floats
    """[T, n] rad/s."""
    qdd: Floats
    """[T, n] rad/s^2."""
    recordings: tuple[slice, ...]
    """Rows of each recording."""
    resting: Floats
    """[T] 1 in the outer halves of the rests and between recordings, else 0: brakes may close there."""


def session(arm: Arm, plan: Plan, random: np.random.Generator) -> Motion:
    """A session with its own moves."""
    gap, length = round(GAP_S / STEP_S), round(plan.seconds / STEP_S)
    posture = _target(arm, random)
    blocks, recordings, resting = [_hold(posture, gap)], [], [np.ones(gap)]
    for _ in range(plan.recordings):
        first = sum(len(block[0]) for block in blocks)
        own = _recording(arm, posture, length, plan.override, random)
        posture = own[0][-1]
        blocks += [own, _hold(posture, gap)]
        recordings.append(slice(first, first + length))
        inside, edge = np.zeros(length), round(_REST_S / 2 / STEP_S)
        inside[:edge] = inside[-edge:] = 1.0
        resting += [inside, np.ones(gap)]
    q, qd, qdd = (np.concatenate([block[k] for block in blocks]) for k in range(3))
    t = np.asarray(STEP_S * np.arange(len(q)), dtype=np.float64)
    return Motion(t, q, qd, qdd, tuple(recordings), np.concatenate(resting))


def given(q: Floats, qd: Floats, qdd: Floats) -> Motion:
    """A session of one recording: a motion [T, n] that somebody else has planned, between two rests."""
    gap, edge = round(GAP_S / STEP_S), round(_REST_S / STEP_S)
    rests = [_hold(posture, gap + edge) for posture in (q[0], q[-1])]
    q, qd, qdd = (np.concatenate([rests[0][k], rows, rests[1][k]]) for k, rows in enumerate((q, qd, qdd)))
    resting = np.zeros(len(q))
    resting[: gap + edge // 2] = resting[-gap - edge // 2 :] = 1.0
    t = np.asarray(STEP_S * np.arange(len(resting)), dtype=np.float64)
    return Motion(t, q, qd, qdd, (slice(gap, len(q) - gap),), resting)


_Block = tuple[Floats, Floats, Floats]


def _recording(
    arm: Arm, posture: Floats, length: int, override: tuple[float, float], random: np.random.Generator
) -> _Block:
    rest = round(_REST_S / STEP_S)
    blocks = [_hold(posture, rest)]
    left = length - 2 * rest
    while left > 0:
        block = _piece(arm, posture, override, random)
        if len(block[0]) > left:
            block = _hold(posture, left)
        posture = block[0][-1]
        blocks.append(block)
        left -= len(block[0])
    blocks.append(_hold(posture, rest))
    q, qd, qdd = (np.concatenate([block[k] for block in blocks]) for k in range(3))
    return q, qd, qdd


def _piece(arm: Arm, posture: Floats, override: tuple[float, float], random: np.random.Generator) -> _Block:
    kind = random.choice(["move", "single", "multisine", "pause"], p=[0.6, 0.18, 0.1, 0.12])
    if kind == "pause":
        return _hold(posture, round(random.uniform(0.4, 2.5) / STEP_S))
    if kind == "multisine":
        return _multisine(arm, posture, random)
    target = _target(arm, random)
    if kind == "single":
        joint = random.integers(arm.joints)
        alone = posture.copy()
        alone[joint] = target[joint]
        target = alone
    return _move(arm, posture, target, float(random.uniform(*override)), random)


def _hold(posture: Floats, rows: int) -> _Block:
    zero = np.zeros((rows, len(posture)))
    return np.tile(posture, (rows, 1)), zero, zero


def _target(arm: Arm, random: np.random.Generator) -> Floats:
    low, high = _range(arm)
    return np.asarray(random.uniform(low, high))


def _range(arm: Arm) -> tuple[Floats, Floats]:
    middle = (arm.lower + arm.upper) / 2
    reach = np.minimum(0.75 * (arm.upper - arm.lower) / 2, _REACH_RAD)
    return middle - reach, middle + reach


def _move(arm: Arm, start: Floats, target: Floats, override: float, random: np.random.Generator) -> _Block:
    """All joints start and stop together; the speed rises as 1 - cos within the first share `ramp` of the time."""
    way, ramp = target - start, random.uniform(0.15, 0.5)
    top, push = 1 / (1 - ramp), np.pi / (2 * ramp * (1 - ramp))
    by_speed = (top * np.abs(way) / (override * arm.speed)).max()
    by_acceleration = np.sqrt(push * np.abs(way) / (override * arm.acceleration)).max()
    rows = max(round(max(by_speed, by_acceleration) / STEP_S), 20)
    duration = rows * STEP_S
    u = (np.arange(rows) + 1) / rows
    place, speed, acceleration = _profile(np.minimum(u, 1 - u), ramp)
    place = np.where(u > 0.5, 1 - place, place)
    acceleration = np.where(u > 0.5, -acceleration, acceleration)
    return (
        start + np.outer(place, way),
        np.outer(speed, way) / duration,
        np.outer(acceleration, way) / duration**2,
    )


def _profile(u: Floats, ramp: float) -> tuple[Floats, Floats, Floats]:
    """Place, speed and acceleration of the first half (u up to 0.5) of a move of length 1 and duration 1."""
    top = 1 / (1 - ramp)
    phase = np.pi * np.minimum(u, ramp) / ramp
    rising = 0.5 * top * (np.minimum(u, ramp) - ramp / np.pi * np.sin(phase))
    place = rising + top * np.maximum(u - ramp, 0.0)
    return place, 0.5 * top * (1 - np.cos(phase)), np.where(u < ramp, 0.5 * top * np.pi / ramp * np.sin(phase), 0.0)


def _multisine(arm: Arm, posture: Floats, random: np.random.Generator) -> _Block:
    """Three sines for each joint under a window that rises and falls as sin^2, back to the posture."""
    rows = round(random.uniform(6, 12) / STEP_S)
    t, duration = STEP_S * np.arange(1, rows + 1), rows * STEP_S
    w, dw = np.sin(np.pi * t / duration) ** 2, np.pi / duration * np.sin(2 * np.pi * t / duration)
    ddw = 2 * (np.pi / duration) ** 2 * np.cos(2 * np.pi * t / duration)
    frequency = 2 * np.pi * random.uniform(0.1, 0.7, (3, 1, arm.joints))
    angle = frequency * t[None, :, None] + random.uniform(0, 2 * np.pi, (3, 1, arm.joints))
    low, high = _range(arm)
    room = np.maximum(np.minimum(posture - low, high - posture), 0.05)
    amplitude = np.minimum(0.5 * arm.speed / frequency.max(axis=0), room) / 3 * random.uniform(0.4, 1.0, arm.joints)
    s = (amplitude * np.sin(angle)).sum(axis=0)
    ds = (amplitude * frequency * np.cos(angle)).sum(axis=0)
    dds = -(amplitude * frequency**2 * np.sin(angle)).sum(axis=0)
    w, dw, ddw = w[:, None], dw[:, None], ddw[:, None]
    return posture + w * s, w * ds + dw * s, w * dds + 2 * dw * ds + ddw * s
