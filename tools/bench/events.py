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
_SECTION = "events: simulated, 20 kHz, 3 phases"


def dips() -> Iterator[Figure]:
    """100 dips of random depth, length and phase, 49.5 to 50.5 Hz."""
    random, errors, missed = np.random.default_rng(1), [], 0
    for _ in range(100):
        u, begin, end, share = _dip(random)
        found = [event for event in _events(u) if event.end is not None and event.kind == "dip"]
        if len(found) != 1:
            missed += 1
            continue
        duration = found[0].duration or 0.0
        errors.append((abs(found[0].extreme - share * _UDIN) / _UDIN, abs(duration - (end - begin)) * 50))
    residual, length = np.max(errors, axis=0)
    yield Figure(_SECTION, "dips missed or in pieces, of 100", missed, "", "<= 0")
    yield Figure(_SECTION, "residual voltage of dips, worst", 100 * residual, "% of Udin", "<= 0.2")
    yield Figure(_SECTION, "duration of dips against that of the disturbance, worst", length, "cycles", "<= 0.5")


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


def _dip(random: np.random.Generator) -> tuple[Floats, float, float, float]:
    """Voltages [samples, phases], begin and end [s], share of the voltage that is left."""
    f, share = random.uniform(49.5, 50.5), random.uniform(0.06, 0.87)
    begin = 1 + random.uniform(0, 0.02)
    end = begin + random.uniform(0.04, 0.5)
    t = np.arange(round(2 * _RATE)) / _RATE
    angle = 2 * np.pi * (f * t[:, None] - np.arange(3) / 3) + random.uniform(0, 2 * np.pi)
    left = np.where((t > begin) & (t < end), share, 1.0)[:, None]
    return _UDIN * np.sqrt(2) * left * np.sin(angle), begin, end, share


def _events(u: Floats) -> list[Event]:
    detector = EventDetector(StreamFormat(_RATE, (1.0, 1.0) * 3, 50.0, 64), Declared(_UDIN))
    codes = np.repeat(u, 2, axis=1)
    return [event for k in range(0, len(codes), 800) for event in detector.feed(_block(codes, k, 800))]


def _block(codes: np.ndarray, begin: int, count: int) -> SampleBlock:
    return SampleBlock(codes[begin : begin + count], begin, round(begin * 1e9 / _RATE))
