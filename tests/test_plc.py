"""The cyclic executive: ring, policy and clock in virtual time; the processes for real."""

from __future__ import annotations

import asyncio
import os
import signal
import time

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acqd.errors import UserError
from acqd.metering import Meter, SampleBlock, StreamFormat
from acqd.metering.block import Codes
from acqd.plc.clock import STEP_NS, StepDetector
from acqd.plc.executive import Executive
from acqd.plc.fast import FastTask, OverrunPolicy
from acqd.plc.realtime import RealtimeSettings
from acqd.plc.ring import GAP, LATE, RUNNING, STEP, Ring, RingLayout
from acqd.plc.slow import SlowTask
from acqd.plc.stats import SLOTS, CycleStats
from acqd.plc.timer import PeriodicTimer
from acqd.sources import SimulationSettings, Source
from acqd.sources.spec import simulated_spec

RATE = 20_000.0


def counted(start: int, stop: int) -> Codes:
    """Samples that tell their own index, in two channels."""
    index = np.arange(start, stop)
    return np.column_stack((index % 30_000, index // 30_000)).astype(np.int16)


def index_of(codes: Codes) -> np.ndarray:
    return codes[:, 0].astype(int) + 30_000 * codes[:, 1].astype(int)


class CountingSource(Source):
    """The fake at the protocol: samples that know their number, and gaps on request."""

    form = StreamFormat(RATE, (0.02, 0.0003))

    def __init__(self, gaps: dict[int, int] | None = None, live: bool = False) -> None:
        self.gaps = gaps or {}
        self.live = live

    def open(self, utc_ns: int, index: int = 0) -> None:
        self.utc, self.next = utc_ns, index

    def read(self, limit: int) -> SampleBlock | None:
        self.next += self.gaps.pop(self.next, 0)
        block = SampleBlock(counted(self.next, self.next + limit), self.next, self.utc)
        self.next += limit
        return block


@pytest.fixture
def ring():
    ring, fd = Ring.create(RingLayout(RATE, 2, 20_000))
    yield ring
    os.close(fd)


@settings(max_examples=60, deadline=None)
@given(steps=st.lists(st.tuples(st.integers(0, 3_000), st.booleans(), st.sampled_from([0, 0, 0, 7, 500])), max_size=40))
def test_ring_hands_over_every_sample_in_order_with_its_index(steps):
    ring, fd = Ring.create(RingLayout(RATE, 2, 8_000))  # a quarter of it is kept clear of the reader
    ring.begin(100, 10**9)
    index, seen, written, expected = 100, [], [], 0
    for count, read, gap in steps:
        if gap:
            ring.event(GAP, gap)
            index += gap
        ring.write(counted(index, index + count))
        written += range(index, index + count)
        index += count
        expected += count
        if read or expected > 1_500:
            for block in ring.read():
                np.testing.assert_array_equal(index_of(block.codes), block.index + np.arange(len(block.codes)))
                assert block.utc_ns == 10**9 + (block.index - 100) * 50_000
                seen += range(block.index, block.index + len(block.codes))
            expected = 0
    for block in ring.read():
        seen += range(block.index, block.index + len(block.codes))
    assert seen == written
    os.close(fd)


def test_a_reader_kept_away_too_long_sees_a_gap_not_garbage(ring):
    ring.begin(0, 0)
    ring.write(counted(0, 15_000))
    ring.write(counted(15_000, 30_000))
    (block,) = ring.read()
    assert block.lost == block.index > 0
    np.testing.assert_array_equal(index_of(block.codes), block.index + np.arange(len(block.codes)))
    assert block.index + len(block.codes) == 30_000


def test_events_travel_with_their_samples(ring):
    ring.begin(0, 0)
    ring.write(counted(0, 1_000))
    ring.event(LATE)
    ring.write(counted(1_000, 1_500))
    ring.event(STEP, 10**12)
    ring.write(counted(1_500, 2_000))
    blocks = ring.read()
    assert [block.flags for block in blocks] == [frozenset(), {"late"}, {"clock_step"}]
    assert blocks[2].utc_ns == 10**12 and blocks[1].utc_ns == 1_000 * 50_000


def test_an_event_at_the_head_waits_for_its_sample(ring):
    ring.begin(0, 0)
    ring.write(counted(0, 800))
    ring.event(STEP, 10**12)
    (before,) = ring.read()
    ring.write(counted(800, 1_600))
    (after,) = ring.read()
    assert not before.flags and after.flags == {"clock_step"} and after.utc_ns == 10**12


def test_samples_overwritten_while_they_are_copied_are_lost_not_torn(ring, monkeypatch):
    ring.begin(0, 0)
    ring.write(counted(0, 14_000))
    take = Ring._overwritten
    calls = []

    def writer_comes_round(self):
        if calls:
            ring.write(counted(14_000, 16_000))
        calls.append(1)
        return take(self)

    monkeypatch.setattr(Ring, "_overwritten", writer_comes_round)
    (block,) = ring.read()
    assert block.lost == block.index == 1_000
    np.testing.assert_array_equal(index_of(block.codes), np.arange(1_000, 14_000))


def run_cycles(ring, source, expirations, policy=None):
    woken = []
    task = FastTask(source, ring, 800.0, lambda: woken.append(task.windows), policy)
    task.start(0, 0)
    for count in expirations:
        task.cycle(count)
    return woken


def test_main_fast_takes_20_samples_a_cycle_and_wakes_once_per_window(ring):
    woken = run_cycles(ring, CountingSource(), [1] * 400)
    assert ring.written == 8_000 and ring.state == RUNNING
    assert woken == list(range(1, 11))


def test_a_short_stall_is_caught_up_without_loss_or_flag(ring):
    run_cycles(ring, CountingSource(), [1] * 10 + [9] + [1] * 10)
    (block,) = ring.read()
    np.testing.assert_array_equal(index_of(block.codes), np.arange(29 * 20))
    assert not block.flags


def test_a_long_stall_is_caught_up_and_flagged_late(ring):
    run_cycles(ring, CountingSource(), [1] * 10 + [150] + [1] * 10)
    blocks = ring.read()
    assert sum(len(block.codes) for block in blocks) == 170 * 20
    assert [block.flags for block in blocks] == [frozenset(), {"late"}]


def test_beyond_the_catch_up_limit_samples_are_given_up_as_an_explicit_gap(ring):
    run_cycles(ring, CountingSource(), [1] * 10 + [700] + [1] * 10, OverrunPolicy(catch_up_ns=200_000_000))
    _before, after = ring.read()
    assert after.index == 200 + 500 * 20 and after.lost == 500 * 20
    np.testing.assert_array_equal(index_of(after.codes), after.index + np.arange(len(after.codes)))


def test_a_gap_of_the_source_reaches_the_row(ring):
    run_cycles(ring, CountingSource({2_000: 37}), [1] * 200)
    meter = Meter(CountingSource.form)
    batch = SlowTask(ring, meter).cycle()
    assert [k for k, flags in zip(batch.seq, batch.flags[0], strict=True) if "gap" in flags] == [2]


@pytest.mark.parametrize("step_s", [-3600.0, -1.0, 0.5, 86_400.0])
def test_clock_steps_are_seen_and_measured(step_s):
    detector = StepDetector()
    offset, found = 0, None
    for window in range(200):
        now = window * 40_000_000 + 2_000_000 + (window % 7) * 1_000_000
        step = int(step_s * 1e9) if window >= 100 else 0
        found = detector.check(now + step, now - 2_000_000 + offset)
        if found is not None:
            assert window >= 100
            offset += found
    assert abs(offset - step_s * 1e9) < STEP_NS


def test_lateness_is_not_mistaken_for_a_clock_step():
    detector = StepDetector()
    random = np.random.default_rng(0)
    for window in range(5_000):
        late = int(random.exponential(20e6)) + (400_000_000 if window % 50 == 0 else 0)
        assert detector.check(window * 40_000_000 + late, window * 40_000_000) is None


def test_cycle_statistics_count_like_cyclictest():
    stats = CycleStats(np.zeros(SLOTS, dtype=np.int64), 1_000_000)
    stats.clear()
    for latency in range(1, 1_001):
        stats.record(latency * 1_000, 1, 30_000)
    stats.record(5_000_000, 4, 1_200_000)
    summary = stats.summary()
    assert (summary.cycles, summary.min_us, summary.max_us) == (1_001, 1, 5_000)
    assert (summary.missed, summary.exceeded, summary.overflow) == (3, 1, 1)
    assert summary.p50_us == 501 and summary.p99_us == 991 and summary.late == 501


def test_timer_counts_every_period():
    timer = PeriodicTimer(1_000_000)
    begun = time.monotonic_ns()
    total = sum(timer.wait() for _ in range(50))
    assert total >= 50 and timer.due_ns - begun <= total * 1_000_000 + 1_000_000
    assert time.monotonic_ns() >= timer.due_ns
    timer.close()


def executive(batches, **settings_):
    spec = simulated_spec(SimulationSettings(**settings_))
    return Executive(spec, Meter, batches.append, realtime=RealtimeSettings(priority=0))


def test_a_crashed_fast_process_is_restarted_and_the_gap_flagged():
    batches = []

    async def scenario():
        ex = executive(batches)
        await ex.start()
        running = asyncio.create_task(ex.run())
        while sum(map(len, batches)) < 10:
            await asyncio.sleep(0.02)
        os.kill(ex.fast_pid, signal.SIGKILL)
        seen = sum(map(len, batches))
        while sum(map(len, batches)) < seen + 15:
            await asyncio.sleep(0.02)
        await ex.stop()
        await running
        assert ex.restarts == 1
        ex.close()

    asyncio.run(asyncio.wait_for(scenario(), 60))
    seq = np.concatenate([batch.seq for batch in batches])
    utc = np.concatenate([batch.utc_ns for batch in batches])
    flags = [flags for batch in batches for flags in batch.flags[0]]
    jump = int(np.argmax(np.diff(seq))) + 1
    assert seq[jump] - seq[jump - 1] > 1 and "gap" in flags[jump]
    assert (np.diff(seq) > 0).all() and all("simulated" in named for named in flags)
    # Time goes on by sample count, and still is this computer's.
    np.testing.assert_array_equal(utc - utc[0], (seq - seq[0]) * 40_000_000)
    assert abs(time.time_ns() - utc[-1]) < 20e9


def clock_set_by(seconds):
    """A UTC that jumps in the fast process half-way through the test, as NTP would set it."""
    return f"""
import time as _t
_real, _start = _t.time_ns, _t.monotonic()
_t.time_ns = lambda: _real() + (int({seconds}e9) if _t.monotonic() - _start > 1.5 else 0)
"""


@pytest.mark.parametrize("step_s", [30, -30])
def test_a_clock_step_reaches_the_rows_and_survives_a_crash(step_s, tmp_path, monkeypatch):
    (tmp_path / "sitecustomize.py").write_text(clock_set_by(step_s))
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    batches = []

    async def scenario():
        ex = executive(batches)
        await ex.start()
        running = asyncio.create_task(ex.run())

        def stepped():
            return any("clock_step" in flags for batch in batches for flags in batch.flags[0])

        while not stepped():
            await asyncio.sleep(0.02)
        os.kill(ex.fast_pid, signal.SIGKILL)
        seen = sum(map(len, batches))
        while sum(map(len, batches)) < seen + 10:
            await asyncio.sleep(0.02)
        await ex.stop()
        await running
        ex.close()

    asyncio.run(asyncio.wait_for(scenario(), 60))
    seq = np.concatenate([batch.seq for batch in batches])
    utc = np.concatenate([batch.utc_ns for batch in batches])
    assert (np.diff(seq) > 0).all() and np.diff(seq).max() < 200  # no leap of the numbers with the clock
    moved = (utc - utc[0]) - (seq - seq[0]) * 40_000_000
    assert abs(moved[np.argmax(np.abs(moved))] - step_s * 1e9) < 0.5e9


def test_stopping_in_the_middle_of_a_restart_ends_the_run():
    async def scenario():
        ex = executive([])
        await ex.start()
        running = asyncio.create_task(ex.run())
        os.kill(ex.fast_pid, signal.SIGKILL)
        while ex.restarts == 0:
            await asyncio.sleep(0.01)
        await ex.stop()
        await asyncio.wait_for(running, 10)
        ex.close()

    asyncio.run(scenario())


def test_an_unusable_source_is_a_user_error_not_a_crash(tmp_path):
    async def scenario():
        ex = Executive({"kind": "replay", "path": str(tmp_path / "no.npz"), "channels": {}, "loops": 1}, Meter, print)
        with pytest.raises(UserError, match="no such file"):
            await ex.start()

    asyncio.run(scenario())


def test_a_bug_in_main_slow_ends_the_run_loudly():
    def broken(_batch):
        raise ZeroDivisionError("planted")

    async def scenario():
        ex = Executive(simulated_spec(SimulationSettings()), Meter, broken, realtime=RealtimeSettings(priority=0))
        await ex.start()
        with pytest.raises(ZeroDivisionError):
            await asyncio.wait_for(ex.run(), 30)
        ex.close()

    asyncio.run(scenario())
