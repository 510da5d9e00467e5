"""Samples and wiring of a running stream."""

from __future__ import annotations

import tomllib
from dataclasses import replace

import numpy as np
import pytest

from acqd.daemon.correction_section import CorrectionSection
from acqd.metering import SampleBlock, StreamFormat
from acqd.metering.run import Run
from acqd.metering.signal_watch import SignalWatch
from acqd.metering.stages import Stages
from acqd.metering.wiring_finding import WiringFinding
from acqd.metering.wiring_watch import WiringWatch
from acqd.sources import load_waveform
from tests.mains import make_mains

SCALE = (737.2575 / 32768, 9.207527 / 32768) * 3
FORM = StreamFormat(20_000.0, SCALE)
TURN = 2 * np.pi / 3 * np.arange(3)


def looks(lag, amperes=(4.0, 4.0, 4.0), volts=(325.0, 325.0, 325.0), order=(0, 1, 2), sign=(1, 1, 1), minutes=2):
    """A window for every second, of a site with exchanged (i`order[k]` is that of phase k) and reversed currents."""
    random = np.random.default_rng(0)
    for second in range(60 * minutes):
        t = (second * 20_000 + np.arange(800)) / 20_000
        angle = 2 * np.pi * 50.02 * t[:, None] - TURN
        codes = random.normal(0, 2, (800, 6))
        codes[:, 0::2] += np.array(volts) * np.cos(angle) / SCALE[0]
        current = np.array(amperes) * random.uniform(0.7, 1.3) * np.cos(angle - lag) / SCALE[1]
        for k in range(3):
            codes[:, 2 * order[k] + 1] += sign[k] * current[:, k]
        yield SampleBlock(np.rint(codes).astype(np.int16), second * 20_000, second * 10**9)


def watched(blocks, form=FORM):
    watch = WiringWatch(form, 230.0)
    for block in blocks:
        watch.feed(block)
    return watch.wired


def pasted(text):
    return CorrectionSection(**tomllib.loads(text.removeprefix("[source] "))["correction"])


@pytest.mark.parametrize(
    ("order", "sign", "text"),
    [((0, 1, 2), (1, -1, 1), "i2 is reversed"), ((1, 0, 2), (1, 1, 1), "currents of L1 and L2 are exchanged"),
     ((1, 2, 0), (1, 1, -1), "rotated")],
)  # fmt: skip
def test_two_minutes_name_the_mistake_and_the_correction_mends_it(order, sign, text):
    blocks = list(looks(0.5, order=order, sign=sign))
    assert watched(blocks[:60]).findings == ()
    (finding,) = watched(blocks).findings
    assert text in finding.text
    section = pasted(finding.correction)
    stages = Stages(FORM, [section.reordered, section.of])
    mended, healthy = stages.apply(blocks[7]), list(looks(0.5))[7]
    begin = (mended.index - blocks[7].index) if mended.index > blocks[7].index else 0
    found = mended.codes * np.array(stages.form.scale)
    expected = (healthy.codes * np.array(SCALE))[begin : begin + len(found)]
    assert np.abs(found - expected).max() < 0.5  # noise of other channels


def test_what_is_pasted_takes_the_correction_that_is_there_into_account():
    there = CorrectionSection(i_order=[2, 1, 3], i_gain=[1.01, 1.02, -1.03], i_delay_us=[1.0, 2.0, 3.0], u_gain=[2.0])
    undone = WiringFinding("", (2, 1, 3), (1, 1, -1))
    assert pasted(there.after(undone)) == CorrectionSection(
        i_gain=[1.02, 1.01, 1.03], i_delay_us=[2.0, 1.0, 3.0], u_gain=[2.0]
    )
    assert CorrectionSection(i_order=[2, 1, 3], i_gain=[1.0, 1.0, -1.0]).after(undone) == "[source] correction = {}"
    assert CorrectionSection(i_gain=[1.5]).after(WiringFinding("u3 missing")) == ""
    rotated = WiringFinding("", (2, 3, 1), (1, -1, 1))
    assert pasted(there.after(rotated)).i_order == [1, 3, 2]
    assert pasted(there.after(rotated)).i_gain == [1.02, 1.03, 1.01]


def test_a_missing_voltage_is_named_and_dead_mains_and_no_load_are_not():
    assert "u3 missing" in watched(looks(0.5, volts=(325.0, 325.0, 4.0))).findings[0].text
    assert "u1 missing" in watched(looks(0.5, volts=(2.0, 325.0, 325.0))).findings[0].text
    assert "u2 and u3 missing" in watched(looks(0.5, volts=(325.0, 4.0, 9.0))).findings[0].text
    assert watched(looks(0.5, volts=(0.0, 0.0, 0.0))).phasors is None
    assert watched(looks(2.9, amperes=(0.004, 0.002, 0.003), sign=(1, -1, 1))).phasors is None


def test_healthy_sites_and_a_left_field_raise_no_warning(waveforms):
    random = np.random.default_rng(3)
    for _ in range(4):
        lag = np.arccos(random.uniform(0.2, 1.0)) + random.normal(0, 0.03, 3)
        assert watched(looks(lag, amperes=4 * random.uniform(0.6, 1.4, 3))).findings == ()
    assert watched(looks(np.array([0.1, 0.1, 0.1]) + np.pi)).findings == ()  # feeds back
    for name in ("generator_3ph", "merging_unit_3ph"):
        wave = load_waveform(waveforms / name / "replay_20k_el3783.npz")
        count = len(wave.codes) // 800
        blocks = (SampleBlock(wave.codes[k % count * 800 :][:800], k * 20_000, k * 10**9) for k in range(120))
        assert watched(blocks, wave.form).findings == ()


def blocks_of(codes, size=800):
    return [SampleBlock(codes[k : k + size], k, k * 50_000) for k in range(0, len(codes) - size + 1, size)]


@pytest.mark.parametrize("compiled", [True, False])
@pytest.mark.parametrize(("noise", "dither"), [(2.0, 0), (30.0, 0), (0.0, 1)])
def test_a_flat_top_that_noise_has_blurred_is_flagged(noise, dither, compiled, monkeypatch):
    if not compiled:
        monkeypatch.setattr("acqd.metering.look.quality_library", lambda: None)
    random, codes = np.random.default_rng(5), make_mains(50.0, seconds=0.9, phases=3).codes.astype(float)
    codes[4_000:, 3] = np.clip(codes[4_000:, 3], None, 0.8 * codes[:, 3].max())
    codes += noise * random.normal(size=codes.shape) + random.integers(-dither, dither + 1, codes.shape)
    watch = SignalWatch(FORM)
    flags = [watch.apply(block).flags for block in blocks_of(np.rint(codes).astype(np.int16))]
    first = flags.index({"clipped"})
    assert 5 <= first <= 10 and set(flags[first:]) == {frozenset({"clipped"})}  # at the next look


def test_flags_come_at_once_and_go():
    codes = make_mains(50.0, seconds=1.5, phases=3).codes
    limit = 0.7 * codes[:, 3].max()
    codes[10_000:20_000, 3] = np.clip(codes[10_000:20_000, 3], -limit, limit)
    watch = SignalWatch(FORM)
    flags = [watch.apply(block).flags for block in blocks_of(codes)]
    flagged = [k for k, named in enumerate(flags) if named == {"clipped"}]
    assert flagged[0] == 13 and 24 <= flagged[-1] <= 35
    assert flagged == list(range(flagged[0], flagged[-1] + 1))
    plain = blocks_of(codes)[0]
    assert SignalWatch(FORM).apply(plain) is plain
    assert SignalWatch(FORM).apply(replace(plain, codes=plain.codes[:100])).flags == frozenset()


@pytest.mark.parametrize("fault", ["clipped", "rollover"])
@pytest.mark.parametrize("block", [800, 8_000])
def test_a_burst_between_two_looks_is_flagged(fault, block):
    codes = make_mains(50.0, seconds=3.2, phases=3).codes.astype(np.int32)
    burst = slice(25_600, 27_200)  # two windows
    if fault == "clipped":
        limit = 0.7 * codes[:, 3].max()
        codes[burst, 3] = np.clip(codes[burst, 3], -limit, limit)
    else:
        codes[:, 2] = codes[:, 2] * 30_500 // codes[:, 2].max()
        codes[burst, 2] = codes[burst, 2] * 7 // 6
    watch = SignalWatch(FORM)
    flags = [watch.apply(one).flags for one in blocks_of(codes.astype(np.int16), block)]
    named = [k for k, one in enumerate(flags) if one == {fault}]
    first, last = burst.start // block, (burst.stop - 1) // block
    assert set(range(first, last + 1)) <= set(named) and len(named) <= 2 * (last - first + 1)
    assert all(one in ({fault}, frozenset()) for one in flags)


def test_no_recording_is_flagged_live(waveforms):
    for path in waveforms.glob("*/*.npz"):
        wave = load_waveform(path)
        watch = SignalWatch(wave.form)
        assert not any(watch.apply(block).flags for block in blocks_of(wave.codes)), path


def pieces_of(codes, rng):
    """Blocks of odd lengths, some of less than a cycle; and the same as one run."""
    edges = np.unique(np.concatenate(([0, len(codes)], np.cumsum(rng.choice([1, 100, 800, 801, 1150, 2500], 300)))))
    run = Run(SampleBlock(codes, 70, 10**18, 5, frozenset({"late"})), edges[edges <= len(codes)].tolist())
    return list(run.blocks(20_000.0)), run


@pytest.mark.parametrize("library", [True, False])
@pytest.mark.parametrize("sizes", ["odd", "live"])
def test_a_run_has_the_flags_of_its_blocks(monkeypatch, library, sizes):
    codes = make_mains(50.0, seconds=3.0, phases=3, noise=0.001).codes
    limit = 0.7 * codes[:, 3].max()
    for begin in (9_000, 21_000, 30_400):
        codes[begin : begin + 1_700, 3] = np.clip(codes[begin : begin + 1_700, 3], -limit, limit)
    blocks, run = pieces_of(codes, np.random.default_rng(3))
    if sizes == "live":
        run = Run(run.block, list(range(0, len(codes) + 1, 800)))
        blocks = list(run.blocks(20_000.0))
    one, other = SignalWatch(FORM), SignalWatch(FORM)
    expected = [one.apply(block) for block in blocks]
    if not library:
        monkeypatch.setattr(other._looker, "_library", None)
    found = list(other.apply_run(run))
    assert other.state() == one.state()
    assert [block.flags for block in found] == [block.flags for block in expected]
    assert {"clipped"} < set().union(*(block.flags for block in found)) and found[0].lost == 5
    assert all((a.codes == b.codes).all() and a.index == b.index for a, b in zip(found, expected, strict=True))


def test_a_calm_run_stays_one_block():
    codes = make_mains(50.0, seconds=1.0, phases=3, noise=0.001).codes
    run = Run(SampleBlock(codes, 0, 0), list(range(0, len(codes) + 1, 800)))
    watch, alone = SignalWatch(FORM), SignalWatch(FORM)
    assert list(watch.apply_run(run)) == [run.block]
    for block in run.blocks(FORM.rate):
        assert alone.apply(block) is block
    assert watch.state() == alone.state()
