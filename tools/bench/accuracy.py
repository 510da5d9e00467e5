"""Accuracy on difficult synthetic mains and on real recordings."""

from __future__ import annotations

from collections.abc import Iterator
from fractions import Fraction

import numpy as np

from acqd.metering import Meter, SampleBlock, WindowBatch
from acqd.metering.registers import Registers
from acqd.sources import load_waveform
from tools.bench.report import Figure
from tools.bench.waves import RECORDINGS, SCALE, Wave, hard_mains

_FREQUENCIES = (49.5, 49.73, 49.9, 50.0, 50.02, 50.31, 50.77, 51.0, 59.5, 59.8, 60.0, 60.13, 60.5)
_RECORDED = ("microwave_1ph_20k", "fridge_1ph_20k", "generator_3ph", "merging_unit_3ph", "ion7650_3ph_60hz")


def _metered(wave: Wave, mode: str = "synchronous") -> WindowBatch:
    batch = Meter(wave.form, mode=mode).feed(SampleBlock(wave.codes, 0, 0))  # type: ignore[arg-type]
    assert batch is not None
    return batch


def synthetic() -> Iterator[Figure]:
    """Worst window of 13 frequencies x 10 s, one and three phases."""
    section = (
        "accuracy: 49.5..51, 59.5..60.5 Hz, EN 50160 harmonics, 0.1 % noise (of RMS), 1 % DC, 16 bit; worst window"
    )
    for phases in (1, 3):
        worst = np.zeros(5)
        for number, f in enumerate(_FREQUENCIES):
            wave = hard_mains(f, phases, 10.0, number)
            batch = _metered(wave)
            errors = (
                np.abs(batch.Vrms / wave.Vrms - 1)[:, 1:].max() * 100,
                np.abs(batch.P - wave.P)[:, 1:].max() / wave.S * 100,
                np.abs(batch.f - f)[1:].max() * 1000,
                np.abs(batch.Q1 - wave.Q1)[:, 1:].max() / wave.S * 100,
                abs(_kvarh(batch) / (wave.Q1 * 0.04 * len(batch) / 3.6e6) - 1) * 100,
            )
            worst = np.maximum(worst, errors)
        yield Figure(section, f"Vrms, {phases}-phase", worst[0], "%", "<= 0.02")
        yield Figure(section, f"P, {phases}-phase", worst[1], "% of S", "<= 0.04")
        yield Figure(section, f"f, {phases}-phase", worst[2], "mHz", "<= 10")
        yield Figure(section, f"Q1, {phases}-phase", worst[3], "% of S")
        yield Figure(section, f"register of quadrant I over 10 s, {phases}-phase", worst[4], "%", "<= 0.02")


def _kvarh(batch: WindowBatch) -> float:
    registers = Registers(len(batch.P), 0.04)
    registers.add(batch)
    return registers.channels["L1"].reactive[0]


def exactness() -> Iterator[Figure]:
    """Fixed mode compared with the textbook sums, W of an hour with exact integers."""
    section = "exactness"
    wave = hard_mains(49.3, 1, 4.0)
    batch = _metered(wave, "fixed")
    u = (wave.codes[:, 0] * SCALE[0]).reshape(-1, 800)
    i = (wave.codes[:, 1] * SCALE[1]).reshape(-1, 800)
    error = max(
        float(np.abs(batch.Vrms[0] / np.sqrt((u * u).mean(axis=1)) - 1).max()),
        float(np.abs(batch.P[0] / (u * i).mean(axis=1) - 1).max()),
    )
    yield Figure(section, "fixed mode against the textbook sums", error, "relative", "<= 1e-9")
    wave = hard_mains(50.03, 1, 60.0)
    meter = Meter(wave.form)
    count = len(wave.codes)
    for minute in range(60):
        last = meter.feed(SampleBlock(wave.codes, minute * count, 0))
    assert last is not None
    products = wave.codes[:, 0].astype(np.int64) * wave.codes[:, 1]
    exact = Fraction(int(products.sum()) * 60) * Fraction(SCALE[0]) * Fraction(SCALE[1]) / 20_000 / 3_600_000
    yield Figure(
        section, "W of 1 h against exact integers", abs(last.W[0, -1] / float(exact) - 1), "relative", "<= 1e-9"
    )


def recordings() -> Iterator[Figure]:
    """Real recordings compared with the references of their folders, ref_40ms.csv."""
    if not RECORDINGS.is_dir():
        return
    for name in _RECORDED:
        section = f"recording {name} against ref_40ms.csv"
        waveform = load_waveform(RECORDINGS / name / "replay_20k_el3783.npz")
        reference = np.genfromtxt(RECORDINGS / name / "ref_40ms.csv", delimiter=",", names=True)
        results = {}
        for mode in ("synchronous", "fixed"):
            batch = Meter(waveform.form, mode=mode).feed(SampleBlock(waveform.codes, 0, 0))
            assert batch is not None
            results[mode] = batch
        at = reference["phase"].astype(int) - 1, reference["k"].astype(int)

        def apart(quantity: np.ndarray, column: str) -> np.ndarray:
            return np.asarray(np.abs(quantity[at] / reference[column] - 1))  # noqa: B023 - used at once

        sync, fixed = results["synchronous"], results["fixed"]
        f = np.abs(sync.f[at[1]] - reference["f_sync"])
        yield Figure(section, "Vrms, median", float(np.nanmedian(apart(sync.Vrms, "U_sync"))) * 100, "%", "<= 0.01")
        yield Figure(section, "f, median", float(np.nanmedian(f)) * 1000, "mHz", "<= 2")
        worst = max(
            float(apart(q, c).max()) for q, c in ((fixed.Vrms, "U_fix"), (fixed.Irms, "I_fix"), (fixed.P, "P_fix"))
        )
        yield Figure(section, "fixed mode: worst of U, I, P", worst, "relative", "<= 1e-6")
        yield Figure(section, "energy: worst", float(apart(fixed.W * 1000, "E_Wh").max()), "relative", "<= 1e-6")
