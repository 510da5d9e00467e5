"""Phase jumps: no window may have a wrong f without a flag."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from acqd.arrays import Floats
from acqd.metering import Meter, SampleBlock, StreamFormat
from tools.bench.report import Figure
from tools.bench.waves import EN50160, SCALE

CASES = 200
_RATE, _SECONDS = 20_000, 0.8
_WRONG_HZ, _WRONG_SHARE = 0.010, 0.001


@dataclass(frozen=True, slots=True)
class Jump:
    """One phase jump of mains with harmonics and noise."""

    f: float
    nominal: float
    degrees: float
    at: float
    """s after the start."""
    phases: int
    seed: int


@dataclass(frozen=True, slots=True)
class Outcome:
    """What the meter made of it."""

    wrong_f: int
    """Windows without a flag, and with f off by more than 10 mHz."""
    wrong_V: int
    """Phases of windows without a flag whose voltage is off by more than 0.1 %."""
    flagged: int
    """Windows flagged `transient`."""
    elsewhere: int
    """Of these, windows that neither hold the jump nor are one of the two after it."""


def cases(count: int) -> Iterator[Jump]:
    """Random jumps of 5 to 60 degrees either way, in 50 and 60 Hz mains of one and three phases in turn."""
    random = np.random.default_rng(18)
    for k in range(count):
        nominal = 60.0 if k % 2 else 50.0
        degrees = float(random.uniform(5, 60) * random.choice((-1, 1)))
        f, at = nominal + float(random.uniform(-0.5, 0.5)), float(random.uniform(0.3, 0.5))
        yield Jump(f, nominal, degrees, at, 3 if k % 4 < 2 else 1, k)


def outcome(jump: Jump) -> Outcome:
    """Meter the windows before, in and after a jump."""
    window = 0.04 if jump.nominal < 55 else 0.05
    meter = Meter(StreamFormat(_RATE, SCALE * jump.phases, f_nominal=jump.nominal), window=window)
    batch = meter.feed(SampleBlock(_codes(jump), 0, 0))
    assert batch is not None
    flagged = np.array(["transient" in flags for flags in batch.flags[0]])
    at, places = int(jump.at / window), np.flatnonzero(flagged)
    good = ~flagged
    good[0] = False  # the start
    f = batch.f[good]
    V = batch.Vrms[:, good] / batch.Vrms[0, 1] - 1
    return Outcome(
        int((~(np.abs(f - jump.f) <= _WRONG_HZ)).sum()),
        int((~(np.abs(V) <= _WRONG_SHARE)).sum()),
        len(places),
        int(((places < at) | (places > at + 2)).sum()),
    )


def jumps() -> Iterator[Figure]:
    """All cases, with the windows that were wrong and those that were given up."""
    section = f"{CASES} phase jumps of 5 to 60 degrees, 50 and 60 Hz, with EN 50160 harmonics"
    outcomes = [outcome(jump) for jump in cases(CASES)]
    yield Figure(section, "windows with a wrong f (10 mHz) and no flag", sum(o.wrong_f for o in outcomes), "", "<= 0")
    yield Figure(section, "voltages off by 0.1 % without a flag", sum(o.wrong_V for o in outcomes), "", "<= 0")
    yield Figure(section, "windows flagged, per jump", sum(o.flagged for o in outcomes) / CASES, "")
    yield Figure(section, "jumps with a flag elsewhere", sum(o.elsewhere > 0 for o in outcomes), "", "<= 0")


def _codes(jump: Jump) -> np.ndarray:
    random = np.random.default_rng(jump.seed)
    t = np.arange(round(_SECONDS * _RATE)) / _RATE
    turns = jump.f * t + jump.degrees / 360 * (t >= jump.at)
    shift = {h: random.uniform(0, 2 * np.pi) for h in EN50160}
    columns: list[Floats] = []
    for phase in range(jump.phases):
        angle = 2 * np.pi * (turns - phase / 3)
        u = np.cos(angle) + sum(level * np.cos(h * angle + shift[h]) for h, level in EN50160.items())
        u += 0.001 * random.standard_normal(len(t))
        columns += [u * 325 / SCALE[0], np.cos(angle - 0.5) * 4.2 / SCALE[1]]
    return np.rint(np.array(columns).T).astype(np.int16)
