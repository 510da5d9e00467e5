"""Disturbances of kinds that `waves.random_disturbance` has not: what the flags of f were not chosen on."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from acqd.arrays import Floats
from tools.bench.waves import EN50160
from tools.studies.frequency.waves import Wave

Random = np.random.Generator
_KINDS = (
    "dip", "capacitor", "inrush", "distortion", "governor", "islanding", "burst", "offset", "jitter", "notches",
)  # fmt: skip
_SECONDS = 1.6


def further_disturbance(number: int) -> Wave:
    """Mains of 47 to 52 or 57 to 62 Hz, one or three phases, with one of these from 0.6 to 0.8 s on.

    A dip of one or all phases, with a jump of the phase there; the ringing of a capacitor that is switched on; the
    inrush of a motor; other harmonics; f of a governor that swings into a new load; a generator that takes over, with
    a jump, a step and a ramp of f; burst firing; an offset that fades; a phase that jitters; a rectifier's notches.
    """
    random = np.random.default_rng(700_000 + number)
    nominal, at = (60.0 if number % 2 else 50.0), float(random.uniform(0.6, 0.8))
    f, angle = nominal + float(random.uniform(-3, 2)), float(random.uniform())
    kind = _KINDS[number // 4 % len(_KINDS)]
    size = float(random.uniform(0.2, 1.0) * random.choice((-1, 1)))
    moved, smooth = _moved(kind, size, at, random)
    noise = float(np.exp(random.uniform(np.log(0.0001), np.log(0.003))))
    scale = float(random.uniform(0.0, 1.2))
    return Wave(
        kind, lambda t: np.asarray(angle + f * t + moved(t)), _SECONDS, 3 if number % 4 < 2 else 1, nominal, noise,
        {h: scale * share for h, share in EN50160.items()}, seed=number,
        smooth=(lambda t: np.asarray(f * t + smooth(t))) if smooth else None,
        level=_level(kind, size, at, random), added=_added(kind, size, at, random, f),
    )  # fmt: skip


def _moved(
    kind: str, size: float, at: float, random: Random
) -> tuple[Callable[[Floats], Floats], Callable[[Floats], Floats] | None]:
    """Cycles beside those of a constant f, of t [s]; the same without the jumps, where there are some."""
    if kind == "governor":  # f falls and swings into a lower one
        decay, beat = float(random.uniform(0.5, 4)), float(random.uniform(0.3, 3))
        pole = complex(-decay, 2 * np.pi * beat)

        def swings(t: Floats) -> Floats:
            late = np.maximum(t - at, 0)
            return np.asarray(0.5 * size * (late - ((np.exp(pole * late) - 1) / pole).real))

        return swings, None
    if kind == "islanding":
        turn, slope = size / 9, float(random.uniform(-1, 1))

        def drifts(t: Floats) -> Floats:
            late = np.maximum(t - at, 0)
            return np.asarray(0.3 * size * late + slope / 2 * late * late)

        return lambda t: np.asarray(turn * (t >= at) + drifts(t)), drifts
    if kind == "dip":
        turn, stay = size / 30, float(random.uniform(0.02, 0.3))
        return lambda t: np.asarray(turn * ((t >= at) & (t < at + stay))), np.zeros_like
    if kind == "jitter":  # of a supply by electronics: white from cycle to cycle, a few mrad
        grid = np.arange(0, _SECONDS + 0.05, 0.005)
        turns = np.cumsum(0.0002 * size * random.standard_normal(len(grid)))
        turns -= np.linspace(0, turns[-1], len(turns))
        return lambda t: np.asarray(np.interp(t, grid, turns)), None
    return np.zeros_like, None


def _level(kind: str, size: float, at: float, random: Random) -> Callable[[Floats], Floats] | None:
    """Magnitude of the voltage, of t [s]."""
    if kind == "dip":
        stay = float(random.uniform(0.02, 0.3))
        return lambda t: np.asarray(1 - 0.6 * abs(size) * ((t >= at) & (t < at + stay)))
    if kind == "inrush":
        fades = float(random.uniform(0.05, 0.5))
        return lambda t: np.asarray(1 - 0.1 * abs(size) * (t >= at) * np.exp(-np.maximum(t - at, 0) / fades))
    if kind == "burst":  # on and off by whole numbers of half cycles
        period = float(random.uniform(0.06, 0.4))
        return lambda t: np.asarray(1 - 0.03 * abs(size) * (t >= at) * ((t / period) % 1 < 0.5))
    return None


def _added(kind: str, size: float, at: float, random: Random, f: float) -> Callable[[Floats, int], Floats] | None:
    """What else is in the voltage of a phase, of t [s]."""
    if kind == "capacitor":
        ring, fades = float(random.uniform(300, 900)), float(random.uniform(0.002, 0.02))

        def rings(t: Floats, phase: int) -> Floats:
            late = np.maximum(t - at, 0)
            return np.asarray(size * (t >= at) * np.exp(-late / fades) * np.cos(2 * np.pi * ring * late + 2 * phase))

        return rings
    if kind == "distortion":
        order, lag = int(random.choice((3, 5, 7, 11))), float(random.uniform(0, 6))
        return lambda t, phase: np.asarray(
            0.06 * size * (t >= at) * np.cos(2 * np.pi * order * (f * t - phase / 3) + lag)
        )
    if kind == "offset":
        fades = float(random.uniform(0.02, 0.3))
        return lambda t, phase: np.asarray(
            0.05 * size * (t >= at) * np.exp(-np.maximum(t - at, 0) / fades) * (1 - phase)
        )
    if kind == "notches":
        width = float(random.uniform(0.005, 0.03))

        def cut(t: Floats, phase: int) -> Floats:
            turns = f * t - phase / 3
            turn = (6 * turns + 0.3) % 1
            return np.asarray(
                -0.2 * abs(size) * (t >= at) * (turn < 6 * width) * np.cos(2 * np.pi * (f * t - phase / 3))
            )

        return cut
    return None
