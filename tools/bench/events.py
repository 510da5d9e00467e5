"""Voltage events: errors of simulated dips and of Urms(1/2), and what watching costs."""

from __future__ import annotations

import time
from collections.abc import Iterator

import numpy as np

from acqd.arrays import Floats
from acqd.metering import Meter, SampleBlock, StreamFormat
from acqd.metering.quality.detector import EventDetector
from acqd.metering.quality.event import Event
from acqd.metering.quality.half_cycle import HalfCycleStream
from acqd.metering.quality.reference import Declared
from tools.bench.report import Figure
from tools.bench.waves import hard_mains

_RATE, _UDIN = 20_000.0, 230.0
_FREQUENCIES = (42.6, 45.0, 49.5, 50.0, 50.31, 51.0, 55.0, 57.4)
_DISTURBED = (49.5, 50.31, 60.12)
_KINDS = ("dip", "swell", "interruption")
_SHARES = {"dip": (0.06, 0.87), "swell": (1.13, 1.6), "interruption": (0.0, 0.04)}
_EVENTS = 1_000
_SECTION = "events: simulated, 20 kHz, 3 phases"


def disturbances() -> Iterator[Figure]:
    """1,000 dips, swells and interruptions of random depth, length and phase, at three frequencies."""
    random, missed = np.random.default_rng(1), 0
    errors: dict[float, list[tuple[float, float]]] = {f: [] for f in _DISTURBED}
    for number in range(_EVENTS):
        f = _DISTURBED[number % len(_DISTURBED)]
        kind = _KINDS[number // len(_DISTURBED) % len(_KINDS)]
        u, begin, end, share = _disturbed(random, f, kind)
        found = [event for event in _events(u, f) if event.end is not None and event.kind == kind]
        if len(found) != 1:
            missed += 1
            continue
        off = (found[0].duration or 0.0) - (end - begin)
        errors[f].append((abs(found[0].extreme - share * _UDIN) / _UDIN, abs(off) * f))
    yield Figure(_SECTION, f"dips, swells, interruptions missed or in pieces, of {_EVENTS}", missed, "", "<= 0")
    for f, pairs in errors.items():
        magnitude, length = np.max(pairs, axis=0)
        name = f"at {f:g} Hz, worst of {len(pairs)}"
        yield Figure(_SECTION, f"extreme voltage {name}", 100 * magnitude, "% of Udin", "<= 0.2")
        yield Figure(_SECTION, f"duration against that of the disturbance {name}", length, "cycles", "<= 0.5")


def steady() -> Iterator[Figure]:
    """Urms(1/2) of steady mains with all harmonics of EN 50160, from 42.5 to 57.5 Hz."""
    worst = 0.0
    for number, f in enumerate(_FREQUENCIES):
        wave = hard_mains(f, 3, 5.0, number)
        stream = HalfCycleStream(wave.form)
        values = [v for k in range(0, len(wave.codes), 800) for v in stream.feed(_block(wave.codes, k, 800))]
        Urms = np.concatenate([each for v in values for each in v.Urms])
        worst = max(worst, float(np.abs(Urms / wave.Vrms - 1).max()))
    yield Figure(_SECTION, "Urms(1/2), 42.6 to 57.4 Hz, harmonics, noise, DC; worst", 100 * worst, "%", "<= 0.2")


def cost() -> Iterator[Figure]:
    """CPU of watching steady mains, in addition to metering it, in blocks of a window."""
    wave = hard_mains(50.02, 3, 20.0)
    detector = EventDetector(wave.form, Declared(_UDIN))
    meter = Meter(wave.form)
    for name, feed in (("meter", meter.feed), ("events", lambda block: list(detector.feed(block)))):
        begun = time.process_time()
        for k in range(0, len(wave.codes), 800):
            feed(_block(wave.codes, k, 800))
        share = (time.process_time() - begun) / (len(wave.codes) / _RATE)
        yield Figure(_SECTION, f"live, windows of 40 ms: {name}", 100 * share, "% of a core")


def _disturbed(random: np.random.Generator, f: float, kind: str) -> tuple[Floats, float, float, float]:
    """Voltages [samples, phases], begin and end [s], share of the voltage that is left."""
    share = random.uniform(*_SHARES[kind])
    begin = 0.5 + random.uniform(0, 1 / f)
    end = begin + random.uniform(2 / f, 0.4)
    t = np.arange(round(1.2 * _RATE)) / _RATE
    angle = 2 * np.pi * (f * t[:, None] - np.arange(3) / 3) + random.uniform(0, 2 * np.pi)
    left = np.where((t > begin) & (t < end), share, 1.0)[:, None]
    return _UDIN * np.sqrt(2) * left * np.sin(angle), begin, end, share


def _events(u: Floats, f: float) -> list[Event]:
    nominal = 60.0 if f > 55 else 50.0
    detector = EventDetector(StreamFormat(_RATE, (1.0, 1.0) * 3, nominal, 64), Declared(_UDIN))
    codes = np.repeat(u, 2, axis=1)
    return [event for k in range(0, len(codes), 800) for event in detector.feed(_block(codes, k, 800))]


def _block(codes: np.ndarray, begin: int, count: int) -> SampleBlock:
    return SampleBlock(codes[begin : begin + count], begin, round(begin * 1e9 / _RATE))
