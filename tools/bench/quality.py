"""Power quality compared with pqopen-lib: the same simulated three-phase arrays, whose quantities are known exactly."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acqd.daemon.quality_feed import GATHERED_S
from acqd.metering import Meter, SampleBlock, StreamFormat
from acqd.metering.gathered import Gathered
from acqd.metering.quality.components import unbalance
from acqd.metering.quality.detector import EventDetector
from acqd.metering.quality.flicker_values import FlickerValues
from acqd.metering.quality.meter import QualityMeter
from acqd.metering.quality.reference import Declared
from acqd.metering.quality.values import QualityValues
from tools.bench.report import Figure
from tools.bench.waves import EN50160, RATE, SCALE, hard_mains

_SECONDS, _SETTLED = 12.0, 4.0
_WARM_S = 2
"""In which libraries are loaded and tables are made."""
_FREQUENCIES = (49.73, 50.02, 50.5)
_BETWEEN = 0.01
"""Interharmonic at 2.5 f, share of U1."""
Floats = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class _Found:
    """Quantities of 10-cycle intervals."""

    harmonics: Floats
    """[intervals, 50] V of L1."""
    between: Floats
    """[intervals, 49] V of L1, between harmonics 1 and 50."""
    thd: Floats
    """% of U, L1."""
    u2: Floats
    u0: Floats
    f: Floats
    """Hz."""
    ms: float
    """Per interval."""


def _wave(f: float, slope: float = 0.0) -> tuple[NDArray[np.int16], tuple[float, float], Floats]:
    """Codes, (u2, u0) in %, and f at every sample; f is `f` in the middle."""
    random = np.random.default_rng(int(100 * f))
    t = np.arange(int(_SECONDS * RATE)) / RATE
    angle = 2 * np.pi * (f * t + slope * (t * t - _SECONDS * t) / 2)
    phasors = np.array([1.0, 0.985 * np.exp(-2.11j), 1.01 * np.exp(2.09j)])
    turns = {h: random.uniform(0, 2 * np.pi) for h in EN50160}
    codes = np.empty((len(t), 6), dtype=np.int16)
    for k, phasor in enumerate(phasors):
        own = angle + np.angle(phasor)
        u = np.abs(phasor) * np.cos(own) + _BETWEEN * np.cos(2.5 * angle)
        for h, share in EN50160.items():
            u += share * np.cos(h * own + turns[h])
        codes[:, 2 * k] = np.rint(u * 230 * np.sqrt(2) / SCALE[0])
        codes[:, 2 * k + 1] = np.rint(np.cos(own - 0.5) * 3 * np.sqrt(2) / SCALE[1])
    return codes, unbalance(phasors), f + slope * (t - _SECONDS / 2)


def _ours(codes: NDArray[np.int16]) -> _Found:
    meter = QualityMeter(StreamFormat(RATE, SCALE * 3))
    begun, values = time.process_time(), list[QualityValues]()
    for start in range(0, len(codes), 800):
        block = SampleBlock(codes[start : start + 800], start, round(start * 1e9 / RATE))
        values += [one for one in meter.feed(block) if one.kind == "10/12"]
    spent = time.process_time() - begun
    late = [one for one in values if one.utc_ns > _SETTLED * 1e9]
    return _Found(
        np.array([one.phase["V_h"][0] for one in late]),
        np.array([one.phase["V_ih"][0, 1:] for one in late]),
        np.array([one.phase["V_thds"][0] for one in late]),
        np.array([one.system["V_u2"] for one in late]),
        np.array([one.system["V_u0"] for one in late]),
        np.array([(one.f, one.utc_ns * 1e-9 + one.duration / 2) for one in late]),
        spent / len(values) * 1e3,
    )


class _Pqopen:
    """Harmonics and unbalance of pqopen-lib, a block at a time."""

    def __init__(self) -> None:
        from daqopen.channelbuffer import AcqBuffer
        from pqopen.powersystem import PowerSystem

        self._buffers = [AcqBuffer(size=600_000, scale_gain=SCALE[k % 2], name=f"c{k}") for k in range(6)]
        self.system = PowerSystem(zcd_channel=self._buffers[0], input_samplerate=RATE, nominal_frequency=50.0, nper=10)
        for phase in range(3):
            u, i = self._buffers[2 * phase : 2 * phase + 2]
            self.system.add_phase(u_channel=u, i_channel=i, name=str(phase + 1))
        self.system.enable_harmonic_calculation(50)

    def feed(self, block: SampleBlock) -> None:
        """The next samples."""
        for channel, buffer in enumerate(self._buffers):
            buffer.put_data(block.codes[:, channel])
        self.system.process()


def _pqopen(codes: NDArray[np.int16]) -> _Found:
    peer = _Pqopen()
    begun = time.process_time()
    for start in range(0, len(codes), 800):
        peer.feed(SampleBlock(codes[start : start + 800], start, 0))
    spent = time.process_time() - begun
    system = peer.system

    def read(name: str) -> tuple[Floats, Floats]:
        values, at = system.output_channels[name].read_data_by_acq_sidx(0, len(codes))
        late = np.asarray(at) > _SETTLED * RATE
        return np.asarray(values, dtype=np.float64)[late], np.asarray(at, dtype=np.float64)[late]

    f, at = (np.convolve(x, np.full(10, 0.1), "valid") for x in read("Freq"))
    # Means of ten periods; a value belongs to the period that ends with it.
    return _Found(
        read("U1_H_rms")[0][:, 1:], read("U1_IH_rms")[0][:, 1:50], read("U1_THD")[0],
        read("U_unbal_2")[0], read("U_unbal_0")[0], np.stack((f, at / RATE - 0.5 / 50), axis=1),
        spent / (len(codes) / RATE * 5) * 1e3,
    )  # fmt: skip


def _errors(found: _Found, truth: tuple[float, float], f: Floats) -> dict[str, float]:
    harmonics, between = np.zeros(50), np.zeros(49)
    harmonics[0] = 1.0
    for h, share in EN50160.items():
        harmonics[h - 1] = share
    between[1] = _BETWEEN
    at = np.clip(np.rint(found.f[:, 1] * RATE).astype(int), 0, len(f) - 1)
    thd = 100 * np.sqrt((harmonics[1:] ** 2).sum())
    return {
        "harmonics, % of U1": float(np.abs(found.harmonics / 230 - harmonics).max() * 100),
        "interharmonic subgroups, % of U1": float(np.abs(found.between / 230 - between).max() * 100),
        "THD, percentage points": float(np.abs(found.thd - thd).max()),
        "u2, percentage points": float(np.abs(found.u2 - truth[0]).max()),
        "u0, percentage points": float(np.abs(found.u0 - truth[1]).max()),
        "f, mHz": float(np.abs(found.f[:, 0] - f[at]).max() * 1000),
    }


_TARGETS = {
    "harmonics, % of U1": "<= 0.1", "interharmonic subgroups, % of U1": "<= 0.1", "THD, percentage points": "<= 0.1",
    "u2, percentage points": "<= 0.15", "u0, percentage points": "<= 0.15", "f, mHz": "<= 10",
}  # fmt: skip


def quality() -> Iterator[Figure]:
    """Worst 10-cycle interval of three frequencies, and of a ramp of 0.25 Hz/s."""
    for title, cases in (
        ("49.73, 50.02, 50.5 Hz", [_wave(f) for f in _FREQUENCIES]),
        ("a ramp of 0.25 Hz/s", [_wave(50.0, 0.25)]),
    ):
        section = f"power quality, simulated, {title}: worst 10-cycle interval"
        results = {name: [(meter(codes), truth, f) for codes, truth, f in cases] for name, meter in _METERS.items()}
        for quantity, target in _TARGETS.items():
            for name, found in results.items():
                worst = max(_errors(*one)[quantity] for one in found)
                value, unit = quantity.rsplit(", ", 1)
                yield Figure(section, f"{value}: {name}", worst, unit, target if name == "acqd" else "")
        for name, found in results.items():
            yield Figure(section, f"duration of an interval: {name}", max(one[0].ms for one in found), "ms")


def cost(seconds: int = 20) -> Iterator[Figure]:
    """CPU of everything that is metered of three phases live, in blocks of a window, beside pqopen-lib.

    The meters take turns, a second of samples each, and medians are compared: other work of the computer hits all.
    """
    section = f"live cost of three phases at 20 kHz, {seconds} s in blocks of 40 ms, median second"
    wave = hard_mains(50.02, 3, float(seconds + _WARM_S))
    theirs = "pqopen-lib: harmonics, unbalance"
    meter, gathered = QualityMeter(wave.form), Gathered(round(GATHERED_S * RATE))  # as the daemon does

    def quality_of(block: SampleBlock) -> list[QualityValues]:
        return [values for joined in gathered.add(block) for values in meter.feed(joined)]

    meters: dict[str, Callable[[SampleBlock], object]] = {
        "rows": Meter(wave.form).feed,
        "harmonics, interharmonics, unbalance": quality_of,
        "events": EventDetector(wave.form, Declared(230.0)).feed,
        "flicker": FlickerValues(wave.form, 230.0).feed,
        theirs: _Pqopen().feed,
    }
    spent: dict[str, list[float]] = {name: [] for name in meters}
    for second in range(seconds + _WARM_S):
        for name, feed in meters.items():
            begun = time.process_time()
            for start in range(round(second * RATE), round((second + 1) * RATE), 800):
                found = feed(SampleBlock(wave.codes[start : start + 800], start, round(start * 1e9 / RATE)))
                if isinstance(found, Iterator):
                    list(found)
            spent[name].append(100 * (time.process_time() - begun))
    shares = {name: float(np.median(each[_WARM_S:])) for name, each in spent.items()}
    for name, share in shares.items():
        yield Figure(section, name, share, "% of a core")
    whole = sum(shares.values()) - shares[theirs]
    yield Figure(section, "all but pqopen-lib", whole, "% of a core", "<= 1.2")
    yield Figure(section, "the same over pqopen-lib's harmonics and unbalance", whole / shares[theirs], "", "<= 0.333")


def pqopen_share(seconds: int = 5) -> float:
    """CPU of pqopen-lib's harmonics and unbalance of three phases, in blocks of 40 ms [% of a core]."""
    wave, peer, spent = hard_mains(50.02, 3, float(seconds + _WARM_S)), _Pqopen(), 0.0
    for start in range(0, len(wave.codes), 800):
        begun = time.process_time()
        peer.feed(SampleBlock(wave.codes[start : start + 800], start, 0))
        spent += (time.process_time() - begun) * (start >= _WARM_S * RATE)
    return 100 * spent / seconds


def beside() -> Iterator[Figure]:
    """An interharmonic of positive sequence, the worst case: what it does to f, and whether that is flagged.

    It sets in after a second; all values count. pqopen-lib has no flag for it.
    """
    t = np.arange(int(_SECONDS * RATE)) / RATE
    for between in (47.0, 48.0, 49.0, 49.5, 51.0, 52.0, 55.0, 58.0, 60.0, 72.0):
        codes = np.empty((len(t), 6), dtype=np.int16)
        for k in range(3):
            u = np.cos(2 * np.pi * (50.02 * t - k / 3)) + 0.02 * (t >= 1.03) * np.cos(2 * np.pi * (between * t - k / 3))
            codes[:, 2 * k] = np.rint(u * 230 * np.sqrt(2) / SCALE[0])
            codes[:, 2 * k + 1] = 0
        values = list(QualityMeter(StreamFormat(RATE, SCALE * 3)).feed(SampleBlock(codes, 0, 0)))
        intervals = [(one.f, bool(_DOUBT & one.flags)) for one in values if one.kind == "10/12"]
        yield from _beside("10-cycle intervals", between, intervals)
        rows = Meter(StreamFormat(RATE, SCALE * 3)).feed(SampleBlock(codes, 0, 0))
        assert rows is not None
        flagged = [bool(_DOUBT & flags) for flags in rows.flags[0]]
        yield from _beside("windows of 40 ms", between, list(zip(rows.f.tolist(), flagged, strict=True)))
        theirs = [(f, False) for f in _pqopen(codes).f[:, 0].tolist()]
        yield from _beside("mean of 10 periods, pqopen-lib", between, theirs)


def _beside(what: str, between: float, values: list[tuple[float, bool]]) -> Iterator[Figure]:
    section = f"power quality, simulated: f of {what} beside an interharmonic of 2 %"
    silent = [abs(f - 50.02) * 1000 for f, flagged in values if not flagged]
    target = "" if "pqopen" in what else "<= 10"
    yield Figure(section, f"{between:g} Hz: worst f that is not flagged", max(silent, default=0.0), "mHz", target)
    yield Figure(section, f"{between:g} Hz: flagged", 100 * (1 - len(silent) / len(values)), "%")


_DOUBT = frozenset({"transient", "unsettled"})
_METERS = {"acqd": _ours, "pqopen-lib": _pqopen}
