"""Samples that are kept: what that costs a core and a disk, and how fast an hour of rows is made again."""

from __future__ import annotations

import os
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from acqd.archive.recorder import Recorder
from acqd.archive.ring import Limits
from acqd.daemon.archive.origin import origin_of, state_of
from acqd.daemon.boot import Boot
from acqd.daemon.config import Config
from acqd.daemon.source_sections import SimulatedSection
from acqd.metering import Meter, SampleBlock
from acqd.metering.signal_watch import SignalWatch
from acqd.metering.stages import Stages
from acqd.sources.load import load_waveform
from acqd.telemetry.row import rows_of
from tools.bench.report import Figure
from tools.bench.waves import RATE, RECORDINGS, hard_mains
from tools.common.commands import acqd_json

_SECTION = "archive: three phases at 20 kHz"
_COST_S, _HOUR_S = 120, 3600
_WINDOW, _UTC_NS = 800, 1_790_000_000_000_000_000
_MOST_WAITING = 2_000_000
_RAW_GB = RATE * 6 * 2 * 86_400 / 1e9


def cost() -> Iterator[Figure]:
    """Processor time with and without an archive, and bytes a day, of simulated and of recorded mains."""
    codes = hard_mains(50.02, 3, 10.0, noise=0.0005).codes
    alone_s = _fed(codes, _COST_S, None)
    with tempfile.TemporaryDirectory() as folder:
        kept_s = _fed(codes, _COST_S, Path(folder))
        size = sum(path.stat().st_size for path in Path(folder).glob("*/*.arc"))
    yield Figure(_SECTION, "to keep all samples, of a core", 100 * (kept_s - alone_s) / _COST_S, "%", "<= 1")
    yield Figure(_SECTION, "raw", _RAW_GB, "GB a day")
    yield Figure(
        _SECTION, "kept, simulated mains (EN 50160 limits, 0.05 % noise)", size / _COST_S * 86_400 / 1e9, "GB a day"
    )
    for name in ("merging_unit_3ph", "generator_3ph"):
        path = RECORDINGS / name / "replay_20k_el3783.npz"
        if path.exists():
            with tempfile.TemporaryDirectory() as folder:
                waveform = load_waveform(path)
                _fed(waveform.codes, 30, Path(folder))
                size = sum(each.stat().st_size for each in Path(folder).glob("*/*.arc"))
            yield Figure(_SECTION, f"kept, {name}, repeated", size / 30 * 86_400 / 1e9, "GB a day")


def again() -> Iterator[Figure]:
    """An hour of rows out of an archive, by the command, in as many processes as there are processors."""
    codes = hard_mains(50.02, 3, 10.0, noise=0.0005).codes
    with tempfile.TemporaryDirectory() as folder:
        _fed(codes, _HOUR_S, Path(folder))
        before = os.times()
        begun = time.perf_counter()
        told = acqd_json("replay", "--archive", folder)
        elapsed, after = time.perf_counter() - begun, os.times()
    cpu_s = after.children_user + after.children_system - before.children_user - before.children_system
    name = f"rows of an hour made again, {len(os.sched_getaffinity(0))} processors"
    yield Figure(_SECTION, name, elapsed, "s", "<= 5")
    yield Figure(_SECTION, "of that, processor time", cpu_s, "s")
    yield Figure(_SECTION, "segments that end with the daemon's state", told["joints_alike"], "of 11", ">= 11")


def _fed(codes: np.ndarray, seconds: int, folder: Path | None) -> float:
    """Meter `codes` again and again for so many seconds of samples, and keep them; processor time [s]."""
    config, source = Config(device="box"), SimulatedSection()
    form = hard_mains(50.0, 3, 0.1).form
    stages = Stages(form, [*source.makers, SignalWatch])
    meter, boot = Meter(stages.form), Boot("bench")
    recorder = Recorder(folder, Limits(10**12, 1e9, 0)) if folder is not None else None
    track = None
    if recorder is not None:
        origin = origin_of(config, source, form, meter)
        track = recorder.track(origin, lambda: (boot.name, state_of(stages, meter, boot)))
    begun, whole = time.process_time(), len(codes) // _WINDOW * _WINDOW
    for index in range(0, round(seconds * RATE), _WINDOW):
        at = index % whole
        block = SampleBlock(codes[at : at + _WINDOW], index, _UTC_NS + index * 50_000)
        if track is not None:
            track.take([block])
        ready = stages.apply(block)
        batch = None if ready is None else meter.feed(ready)
        if batch is not None:
            boot.stamp(list(rows_of(batch, config.device, boot.name)))
        while recorder is not None and recorder.waiting > _MOST_WAITING:
            time.sleep(0.01)
    if track is not None and recorder is not None:
        track.finish()
        recorder.close(600.0)
    return time.process_time() - begun
