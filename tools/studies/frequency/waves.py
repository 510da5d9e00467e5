"""Simulated mains whose f is known at every instant."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from acqd.arrays import Floats
from acqd.metering import StreamFormat
from acqd.metering.block import Codes
from tools.bench.waves import EN50160, RATE, SCALE

VOLTS, AMPERES, LAG = 230.0, 3.0, 0.5


@dataclass(frozen=True, slots=True)
class Wave:
    """Mains of one or three phases."""

    name: str
    turns: Callable[[Floats], Floats]
    """Cycles of the fundamental since t = 0, of t [s]."""
    seconds: float = 6.0
    phases: int = 1
    nominal: float = 50.0
    noise: float = 0.001
    """Of the RMS voltage."""
    harmonics: dict[int, float] = field(default_factory=lambda: EN50160)
    between: tuple[float, float] = (0.0, 72.0)
    """Share and Hz of an interharmonic."""
    seed: int = 0
    smooth: Callable[[Floats], Floats] | None = None
    """The cycles without a jump of the phase: f is their rate."""
    level: Callable[[Floats], Floats] | None = None
    """Magnitude of the voltage, of t [s]; 1 where that is not given."""
    begins: float = 0.0
    """s at which the interharmonic sets in."""
    added: Callable[[Floats, int], Floats] | None = None
    """What else is in the voltage of a phase, of t [s] and the phase; shares of the fundamental's amplitude."""

    @property
    def form(self) -> StreamFormat:
        """Of the codes."""
        return StreamFormat(RATE, SCALE * self.phases, f_nominal=self.nominal)

    @property
    def V(self) -> float:  # noqa: N802
        """True RMS voltage over whole cycles, without the interharmonic."""
        return VOLTS * float(np.sqrt(1 + sum(a * a for a in self.harmonics.values()) + self.noise**2))

    def codes(self) -> Codes:
        """Of 16 bits."""
        random = np.random.default_rng(self.seed)
        t = (np.arange(round(self.seconds * RATE)) + 0.5) / RATE
        turns, (share, f) = self.turns(np.asarray(t)), self.between
        columns: list[Floats] = []
        for phase in range(self.phases):
            angle = 2 * np.pi * (turns - phase / 3)
            u = np.cos(angle) + sum(level * np.cos(h * angle + h) for h, level in self.harmonics.items())
            u += share * np.cos(2 * np.pi * (f * t - phase / 3)) * (t >= self.begins)
            u *= 1.0 if self.level is None else self.level(np.asarray(t))
            u += 0.0 if self.added is None else self.added(np.asarray(t), phase)
            u += self.noise / np.sqrt(2) * random.standard_normal(len(t))
            columns += [u * VOLTS * np.sqrt(2) / SCALE[0], np.cos(angle - LAG) * AMPERES * np.sqrt(2) / SCALE[1]]
        return np.rint(np.array(columns).T).astype(np.int16)

    def true_f(self, begin: Floats, end: Floats) -> Floats:
        """Mean f [Hz] between two sample positions."""
        turns = self.smooth or self.turns
        return np.asarray((turns(end / RATE) - turns(begin / RATE)) / ((end - begin) / RATE))


def swing(amplitude: float, f: float) -> Callable[[Floats], Floats]:
    """f = 50.03 + amplitude sin(2 pi f t) [Hz]."""
    return lambda t: 50.03 * t - amplitude / (2 * np.pi * f) * np.cos(2 * np.pi * f * t)


def ramp(slope: float, seconds: float = 6.0) -> Callable[[Floats], Floats]:
    """f through 50 Hz in the middle, `slope` [Hz/s]."""
    return lambda t: (50 - slope * seconds / 2) * t + slope * t * t / 2


def jump(degrees: float, at: float, f: float = 50.03) -> Callable[[Floats], Floats]:
    """A step of the phase."""
    return lambda t: f * t + degrees / 360 * (t >= at)


def wandering(step: float, seed: int, seconds: float = 6.0) -> Callable[[Floats], Floats]:
    """f in a random walk with steps of so many Hz (standard deviation) every 40 ms, straight in between."""
    random = np.random.default_rng(seed)
    grid = np.arange(0, seconds + 0.09, 0.04)
    f = 50.02 + np.cumsum(step * random.standard_normal(len(grid)))
    turns = np.concatenate(([0.0], np.cumsum((f[1:] + f[:-1]) / 2 * 0.04)))

    def of(t: Floats) -> Floats:
        k = np.minimum((t / 0.04).astype(int), len(grid) - 2)
        rest = t - grid[k]
        return np.asarray(turns[k] + f[k] * rest + (f[k + 1] - f[k]) / 0.08 * rest * rest)

    return of


def cases() -> list[Wave]:
    """Of the table."""
    waves = [Wave(f"noise {100 * noise:g} %", lambda t: 50.03 * t, noise=noise) for noise in (0.0001, 0.001, 0.005)]
    waves += [Wave(f"ramp {slope:g} Hz/s", ramp(slope)) for slope in (0.1, 0.3, 1.0, 1.6)]
    waves.append(Wave("ramp 10 Hz/s, three phases", ramp(10.0, 1.0), seconds=1.0, phases=3))
    waves += [
        Wave(f"swing {amplitude:g} Hz at {f:g} Hz", swing(amplitude, f))
        for amplitude, f in (
            (0.01, 1.0), (0.1, 0.1), (0.1, 1.0), (0.1, 5.0), (0.1, 10.0),
            (0.5, 0.1), (0.5, 1.0), (0.5, 5.0), (0.5, 10.0),
        )
    ]  # fmt: skip
    waves += [Wave(f"wander {1000 * step:g} mHz/40 ms", wandering(step, 3)) for step in (0.0005, 0.002)]
    waves += [Wave(f"interharmonic 1 % at {f:g} Hz", lambda t: 50.03 * t, between=(0.01, f)) for f in (48.0, 72.0)]
    waves += [Wave(f"jump {degrees:g} deg", jump(degrees, 3.017), smooth=jump(0.0, 0.0)) for degrees in (5.0, 30.0)]
    return waves


_KINDS = ("jump", "ramp", "swing", "step", "interharmonic", "onset", "level", "flicker", "load", "wander")


def random_disturbance(number: int) -> Wave:
    """Mains of 50 or 60 Hz, one or three phases, noise from 0.01 to 0.3 %, harmonics up to 1.2 times EN 50160.

    From 0.6 to 0.8 s on: a jump of the phase, a ramp, a swing or a step of f, an interharmonic (also one that is there
    from the start on), a step of the voltage or one with a jump, flicker; or f that wanders all the time.
    """
    random = np.random.default_rng(1000 + number)
    nominal, at = (60.0 if number % 2 else 50.0), float(random.uniform(0.6, 0.8))
    f, angle = nominal + float(random.uniform(-0.4, 0.4)), float(random.uniform())
    kind = _KINDS[number // 4 % len(_KINDS)]
    size = float(random.uniform(0.2, 1.0) * random.choice((-1, 1)))
    beat = float(np.exp(random.uniform(np.log(0.5), np.log(10))))
    wander = wandering(0.001 * abs(size), number, 1.6)

    def turns(t: Floats) -> Floats:
        late = np.maximum(t - at, 0)
        moved = {
            "jump": size / 6 * (t >= at),
            "load": size / 90 * (t >= at),
            "ramp": size * late * late,
            "swing": 0.1 * size / (2 * np.pi * beat) * (1 - np.cos(2 * np.pi * beat * late)),
            "step": 0.3 * size * late,
            "wander": wander(t) - 50 * t,
        }
        return np.asarray(angle + f * t + moved.get(kind, 0.0))

    def level(t: Floats) -> Floats:
        later = t >= at
        changes = {
            "level": 0.08 * size * later,
            "load": 0.03 * size * later,
            "flicker": 0.02 * size * later * np.sin(2 * np.pi * 2 * beat * (t - at)),
        }
        return np.asarray(1 + changes.get(kind, 0.0))

    beside = kind in {"interharmonic", "onset"}
    between = (abs(size) * 0.02 if beside else 0.0, nominal + float(random.uniform(-8, 30)))
    noise = float(np.exp(random.uniform(np.log(0.0001), np.log(0.003))))
    scale = float(random.uniform(0.0, 1.2))
    return Wave(
        kind, turns, 1.6, 3 if number % 4 < 2 else 1, nominal, noise,
        {h: scale * share for h, share in EN50160.items()}, between, seed=number,
        smooth=jump(0.0, 0.0, f) if kind in {"jump", "load"} else None,
        level=level, begins=at if kind == "onset" else 0.0,
    )  # fmt: skip
