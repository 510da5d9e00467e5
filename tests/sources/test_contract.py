"""What every source with its own sampling clock promises, on the wire of its device's double."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from acqd.plc.fast import FastTask
from acqd.plc.ring import Ring, RingLayout
from acqd.sources import ChannelMap, SimulationSettings, Source
from acqd.sources.spec import make_source, replay_spec, simulated_spec
from tests.doubles.waveform import WaveTable
from tests.sources.bench import START_NS, Bench, Tape


def test_every_sample_arrives_once_and_bit_for_bit(bench: Bench):
    bench.open()
    bench.until(lambda: bool(bench.tape.blocks))
    bench.step(60)
    assert bench.tape.blocks[0].index == 0 and bench.tape.lost == 0
    assert len(bench.tape.index) >= 59 * bench.step_samples
    bench.tape.offset(bench.codes, bench.search)
    assert bench.source.health().lost == 0 and bench.source.health().connected


def test_the_reader_may_take_as_little_as_it_likes(bench: Bench):
    bench.open()
    bench.until(lambda: bool(bench.tape.blocks))
    bench.step(20, limit=7)
    assert max(len(block.codes) for block in bench.tape.blocks[1:]) <= max(7, len(bench.tape.blocks[0].codes))
    assert bench.tape.lost == 0
    bench.tape.offset(bench.codes, bench.search)


def test_the_source_says_how_often_it_must_be_woken(bench: Bench):
    assert 0 < bench.source.period_ns <= 100_000_000 and not bench.source.paced and bench.source.live


def test_a_start_in_mid_stream_goes_on_behind_a_gap_as_long_as_the_outage(bench: Bench):
    bench.open(index=1_000_000)
    bench.clock.now += 2_000_000_000
    bench.until(lambda: bool(bench.tape.blocks))
    expected = 1_000_000 + (bench.clock.now - 10**12) * 1e-9 * bench.source.form.rate
    assert abs(bench.tape.blocks[0].index - expected) < 0.2 * bench.source.form.rate


def test_every_lost_sample_is_accounted_for_as_a_gap(bench: Bench):
    bench.open()
    bench.until(lambda: bool(bench.tape.blocks))
    bench.step(10)
    lost = bench.lose()
    bench.step(20)
    assert bench.tape.lost == lost == bench.source.health().lost
    bench.tape.offset(bench.codes, bench.search)


def test_over_range_is_flagged_on_the_samples_concerned_and_on_no_others(bench: Bench):
    bench.open()
    bench.until(lambda: bool(bench.tape.blocks))
    bench.step(5)
    assert bench.tape.flagged("overrange") == 0
    bench.over_range(True)
    bench.step(3)
    bench.over_range(False)
    bench.step(10)
    flagged = bench.tape.flagged("overrange")
    assert 2 * bench.step_samples <= flagged <= 5 * bench.step_samples
    assert "overrange" not in bench.tape.blocks[-1].flags


@pytest.mark.parametrize("seconds", [0.001, 1.0, 12.0])
def test_a_lost_connection_is_said_and_survived(bench: Bench, seconds):
    bench.open()
    bench.until(lambda: bool(bench.tape.blocks))
    bench.step(10)
    last = int(bench.tape.index[-1])
    bench.disconnect()
    bench.pass_time(seconds)
    away_since = bench.clock.now - round(seconds * 1e9)
    if seconds >= 1:
        bench.until(lambda: not bench.source.health().connected)
        reason = bench.source.health().reason
        assert reason and "\n" not in reason
    bench.reconnect()
    before, bench.tape = bench.tape, Tape()
    bench.until(lambda: bool(bench.tape.blocks))
    health = bench.source.health()
    assert health.connected and not health.reason and health.reconnects == (1 if seconds >= 1 else health.reconnects)
    bench.step(10)
    if bench.keeps_count or seconds < 0.01:  # the device's own counter says exactly how many samples are missing
        before.blocks += bench.tape.blocks
        before.offset(bench.codes, bench.search)
    else:
        gap_s = (bench.tape.blocks[0].index - last) / bench.source.form.rate
        elapsed_s = (bench.clock.now - away_since) * 1e-9 - 10 * bench.step_samples / bench.source.form.rate
        assert abs(gap_s - elapsed_s) < 0.3 and bench.tape.lost == 0
        bench.tape.offset(bench.codes, bench.search)


def test_a_restarted_device_goes_on_by_time_never_backwards(bench: Bench):
    bench.open()
    bench.until(lambda: bool(bench.tape.blocks))
    bench.step(30)
    last = int(bench.tape.index[-1])
    bench.restart()
    before, bench.tape = bench.tape, Tape()
    bench.until(lambda: bool(bench.tape.blocks))
    bench.step(30)
    assert bench.tape.blocks[0].index > last
    expected = (bench.clock.now - 10**12) * 1e-9 * bench.source.form.rate
    assert abs(bench.tape.index[-1] - expected) < 0.6 * bench.source.form.rate
    assert before.blocks and bench.source.health().connected


def test_a_sampling_clock_100_ppm_off_loses_and_repeats_nothing(bench: Bench):
    bench.open()
    bench.until(lambda: bool(bench.tape.blocks))
    for _ in range(100):
        bench.clock.now += round(bench.step_samples * 1e9 / bench.source.form.rate * 1e-4)
        bench.step()
    assert bench.tape.lost == 0
    bench.tape.offset(bench.codes, bench.search)


def test_main_fast_passes_the_samples_on_with_index_time_flags_and_gaps(bench: Bench):
    form = bench.source.form
    ring, descriptor = Ring.create(RingLayout(form.rate, len(form.scale), int(form.rate), form.bits))
    bench.source.live = False  # virtual time is not this computer's
    task = FastTask(bench.source, ring, 0.04 * form.rate, lambda: None)
    task.start(START_NS, 0)
    tape = Tape()
    for number in range(200):
        bench.advance()
        if number == 150:
            bench.lose()
        task.cycle(1)
        for block in ring.read():
            tape.add(block)
    assert ring.health().connected and tape.lost == ring.health().lost > 0
    tape.offset(bench.codes, bench.search)
    rate_error = [block.utc_ns - tape.blocks[0].utc_ns - block.index * 1e9 / form.rate for block in tape.blocks]
    assert max(rate_error) - min(rate_error) < 2
    os.close(descriptor)


def paced(kind: str, folder: Path) -> Source:
    """The sources without their own sampling clock, as the fast process makes them."""
    if kind == "simulated":
        return make_source(simulated_spec(SimulationSettings(phases=1)))
    wave = WaveTable(phases=1, seconds=0.4)
    np.savez(
        folder / "a.npz", u_code=wave.codes(0, 8_000)[:, 0], i_code=wave.codes(0, 8_000)[:, 1],
        u_V_per_digit=wave.scale[0], i_A_per_digit=wave.scale[1], fs=20_000,
    )  # fmt: skip
    return make_source(replay_spec(folder / "a.npz", ChannelMap(), 0))


@pytest.mark.parametrize("kind", ["simulated", "replay"])
def test_paced_sources_keep_the_same_contract(kind, tmp_path):
    whole, pieces, later = (paced(kind, tmp_path) for _ in range(3))
    for source in (whole, pieces, later):
        source.connect()
        assert source.paced and source.health().connected
        assert source.period_ns == {"simulated": 1_000_000, "replay": 10_000_000}[kind]  # files wait for nobody
        assert source.correction_ns() == 0
    whole.open(START_NS)
    pieces.open(START_NS)
    later.open(START_NS, index=777)
    expected = whole.read(3_000)
    tape = Tape()
    for limit in (1, 20, 979, 2_000):
        pieces.exchange()
        tape.add(pieces.read(limit))
    np.testing.assert_array_equal(np.concatenate([block.codes for block in tape.blocks]), expected.codes)
    assert tape.lost == 0 and tape.blocks[-1].utc_ns == START_NS + 1_000 * 50_000
    assert later.read(10).index == 777
    later.skip(500)
    assert later.read(10).index == 1_287
    for source in (whole, pieces, later):
        source.close()
        source.close()


def test_closing_twice_is_allowed(bench: Bench):
    bench.open()
    bench.step(3)
    bench.source.close()
    bench.source.close()
    assert np.isfinite(bench.source.form.rate)
