"""Throughput compared with pqopen-lib, of `acqd replay`, and duration of one MAIN_SLOW cycle."""

from __future__ import annotations

import statistics
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np

from acqd.metering import Meter, SampleBlock
from acqd.telemetry.row import json_lines, rows_of
from tools.bench.report import Figure
from tools.bench.waves import SCALE, Wave, hard_mains
from tools.common.commands import acqd_json

_SECONDS = 120.0  # the first windows, metered with numpy while f is searched for, must not decide
_ROUNDS = 5


def _ours(wave: Wave, samples: int) -> float:
    """Real-time factor of the meter, fed with blocks of `samples`; by CPU time, for others may use the core."""
    meter = Meter(wave.form)
    begun = time.process_time()
    for start in range(0, len(wave.codes), samples):
        meter.feed(SampleBlock(wave.codes[start : start + samples], start, 0))
    return len(wave.codes) / 20_000 / (time.process_time() - begun)


def _pqopen(wave: Wave, samples: int) -> tuple[float, float, float]:
    """Real-time factor, worst error of U [%] and of f [mHz] of pqopen-lib with two-period values."""
    from daqopen.channelbuffer import AcqBuffer
    from pqopen.powersystem import PowerSystem

    buffers = [AcqBuffer(size=200_000, scale_gain=SCALE[k % 2], name=f"c{k}") for k in range(6)]
    system = PowerSystem(zcd_channel=buffers[0], input_samplerate=20_000.0, nominal_frequency=50.0, nper=2)
    for phase in range(3):
        system.add_phase(u_channel=buffers[2 * phase], i_channel=buffers[2 * phase + 1], name=str(phase + 1))
    system.enable_rms_trapz_rule()
    begun = time.process_time()
    for start in range(0, len(wave.codes), samples):
        for channel, buffer in enumerate(buffers):
            buffer.put_data(wave.codes[start : start + samples, channel])
        system.process()
    factor = len(wave.codes) / 20_000 / (time.process_time() - begun)
    # Its channels keep the last values only; in the first seconds its zero-crossing filter settles.
    u, _ = system.output_channels["U1_rms"].read_data_by_acq_sidx(len(wave.codes) // 2, len(wave.codes))
    f, _ = system.output_channels["Freq"].read_data_by_acq_sidx(len(wave.codes) // 2, len(wave.codes))
    return factor, float(np.abs(u / wave.Vrms - 1).max() * 100), float(np.abs(f - wave.f).max() * 1000)


def pqopen() -> Iterator[Figure]:
    """acqd and pqopen-lib in turn on one core: the same three-phase arrays, the same quantities."""
    section = "compared with pqopen-lib 0.10.5, three phases at 20 kHz, CPU time"
    wave = hard_mains(50.03, 3, _SECONDS)
    ours, window_by_window, peer = [], [], []
    for _ in range(_ROUNDS):
        peer.append(_pqopen(wave, 800))
        window_by_window.append(_ours(wave, 800))
        ours.append(_ours(wave, 200_000))
    batch = Meter(wave.form).feed(SampleBlock(wave.codes, 0, 0))
    assert batch is not None
    factors = [p[0] for p in peer]

    def ratio(mine: list[float]) -> float:  # of runs side by side
        return statistics.median(a / b for a, b in zip(mine, factors, strict=True))

    yield Figure(section, "pqopen-lib, 40 ms blocks", statistics.median(factors), "x real time")
    yield Figure(section, "acqd, as replay feeds it (10 s blocks)", statistics.median(ours), "x real time")
    yield Figure(
        section, "acqd, 40 ms blocks (as MAIN_SLOW feeds it)", statistics.median(window_by_window), "x real time"
    )
    yield Figure(section, "replay blocks, ratio to pqopen-lib", ratio(ours), "", ">= 20")
    yield Figure(section, "40 ms blocks, ratio to pqopen-lib", ratio(window_by_window), "", ">= 20")
    yield Figure(section, "worst U: pqopen-lib", peer[0][1], "%")
    yield Figure(
        section,
        "worst U: acqd",
        float(np.abs(batch.Vrms[0, 1:] / wave.Vrms - 1).max() * 100),
        "%",
        f"<= {peer[0][1]:.4g}",
    )
    yield Figure(section, "worst f: pqopen-lib", peer[0][2], "mHz")
    yield Figure(
        section, "worst f: acqd", float(np.abs(batch.f[1:] - wave.f).max() * 1000), "mHz", f"<= {peer[0][2]:.4g}"
    )


def kernel() -> Iterator[Figure]:
    """A window in C and with numpy, CPU time: shortest of several rounds."""
    section = "a window of 40 ms at 20 kHz, CPU time"
    for phases in (3, 1):
        wave = hard_mains(50.0, phases, 10.0)
        for samples, name in ((800, "live"), (200_000, "10 s blocks")):
            fast, slow = _window_us(wave, samples, compiled=True), _window_us(wave, samples, compiled=False)
            target = "<= 15" if phases == 3 and samples == 800 else ""
            yield Figure(section, f"{phases}-phase, {name}", fast, "us", target)
            yield Figure(
                section, f"{phases}-phase, {name}: real time", 40_000 / fast, "x", ">= 2500" if not target else ""
            )
            yield Figure(section, f"{phases}-phase, {name}, numpy", slow, "us")


def _window_us(wave: Wave, samples: int, *, compiled: bool) -> float:
    """CPU time of the meter per window [us]; the recording is played again and again."""
    meter = Meter(wave.form, compiled=compiled)
    position, rounds = 0, []
    for _ in range(_ROUNDS):
        begun = time.process_time()
        for start in range(0, len(wave.codes), samples):
            meter.feed(SampleBlock(wave.codes[start : start + samples], position + start, 0))
        position += len(wave.codes)
        rounds.append((time.process_time() - begun) / len(wave.codes) * 800e6)
    return min(rounds)


def replay() -> Iterator[Figure]:
    """`acqd replay --speed max` on ten minutes, rows to a file; the program's start does not count."""
    section = "acqd replay --speed max (rows to a file)"
    for phases, target in ((1, 2000), (3, 1200)):
        wave = hard_mains(50.03, phases, 60.0)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "w.npz"
            u, i = wave.codes[:, 0::2].T, wave.codes[:, 1::2].T
            np.savez(path, u_code=u, i_code=i, u_V_per_digit=SCALE[0], i_A_per_digit=SCALE[1], fs=20_000)
            factors = []
            for _ in range(3):
                report = acqd_json("replay", path, "--loops", 10, "--out", f"{folder}/r")
                factors.append(report["recorded_s"] / report["elapsed_s"])
        yield Figure(section, f"{phases}-phase", statistics.median(factors), "x real time", f">= {target}")
        yield from _bounds(section, wave, statistics.median(factors))


def _bounds(section: str, wave: Wave, factor: float) -> Iterator[Figure]:
    """What a window costs: one pass over the samples, metering, rows."""
    codes = wave.codes
    windows = len(codes) / 800
    memory = _best(lambda: np.ascontiguousarray(codes.T, dtype=np.float64)) / windows * 1e6
    metering = 0.04e6 / max(_ours(wave, 200_000) for _ in range(3))
    batch = Meter(wave.form).feed(SampleBlock(codes, 0, 0))
    assert batch is not None
    rows = _best(lambda: json_lines(rows_of(batch, "d", "b"))) / windows * 1e6
    phases = wave.form.phases
    yield Figure(section, f"{phases}-phase: whole window", 0.04e6 / factor, "us")
    yield Figure(section, f"{phases}-phase: of that metering", metering, "us")
    yield Figure(section, f"{phases}-phase: of that rows and JSON", rows, "us")
    yield Figure(section, f"{phases}-phase: one pass over the samples (int16 to double)", memory, "us")


def _best(work: Callable[[], object]) -> float:
    """Shortest of three runs [s]."""
    times = []
    for _ in range(3):
        begun = time.perf_counter()
        work()
        times.append(time.perf_counter() - begun)
    return min(times)


def main_slow() -> Iterator[Figure]:
    """One cycle: from 800 new samples of three phases to four JSON payloads."""
    section = "one MAIN_SLOW cycle, three phases, JSON included"
    wave = hard_mains(50.03, 3, 40.0)
    meter = Meter(wave.form)
    times = []
    for start in range(0, len(wave.codes), 800):
        begun = time.perf_counter()
        batch = meter.feed(SampleBlock(wave.codes[start : start + 800], start, 0))
        assert batch is not None
        for row in rows_of(batch, "device", "boot"):
            row.to_json()
        times.append((time.perf_counter() - begun) * 1e3)
    yield Figure(section, "median", statistics.median(times), "ms", "<= 0.5")
    yield Figure(section, "99th percentile", float(np.percentile(times, 99)), "ms")
    yield Figure(section, "share of a core", statistics.median(times) / 40 * 100, "%", "<= 1.5")
