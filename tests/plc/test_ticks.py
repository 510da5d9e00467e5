"""Cycles in C and in Python do the same."""

from __future__ import annotations

import os
import time
from contextlib import contextmanager

import numpy as np
import pytest

from acqd.plc.fast import FastTask, OverrunPolicy, run_fast
from acqd.plc.ring import ENDED, STOPPED, Ring, RingLayout
from acqd.plc.stats import CycleStats
from acqd.plc.ticks_library import library_path
from acqd.sources.replay import ReplaySource
from acqd.sources.waveform import Waveform
from tests.plc.counting import RATE, CountingSource, counted, index_of

SAMPLES = 3_010  # the recording begins again in mid-window
FORM = CountingSource.form
PERIOD_NS = 2_000_000
WINDOW = 800
CAPACITY = 9_000  # of the ring: smaller than the stream, which is written around its end
CATCH_UP = OverrunPolicy(catch_up_ns=440_000_000)
"""Stalls of a busy machine as long as the ring are caught up with: none of the samples below is given up."""
needs_c = pytest.mark.skipif(library_path() is None, reason="no C compiler")


def recording(loops, live=False):
    source = ReplaySource(Waveform("r", counted(0, SAMPLES), FORM, None), loops)
    source.period_ns, source.live = PERIOD_NS, live
    return source


def run(source, library, ring, stop=lambda: False, fd=None):
    wake_fd = os.eventfd(0, os.EFD_NONBLOCK)
    wake = wake_fd if fd else None
    task = FastTask(source, ring, float(WINDOW), lambda: os.eventfd_write(wake_fd, 1), CATCH_UP, wake_fd=wake)
    run_fast(task, source, ring, utc_ns=time.time_ns(), index=0, stop=stop, library=library)
    woken = os.eventfd_read(wake_fd)
    os.close(wake_fd)
    return woken, task


@contextmanager
def made_ring():
    ring, fd = Ring.create(RingLayout(RATE, 2, CAPACITY))
    yield ring
    ring.close()
    os.close(fd)


@pytest.fixture
def small_ring():
    with made_ring() as ring:
        yield ring


def missed(ring):
    """Cycles that the machine's stalls have cost."""
    return CycleStats(ring.cycle_slots, PERIOD_NS).summary().missed


def newest(ring):
    """Samples that the ring still holds, in order."""
    end, capacity = ring.written, ring.layout.capacity
    return index_of(ring.codes[np.arange(max(0, end - capacity), end) % capacity])


@needs_c
@pytest.mark.parametrize("live", [False, True])
@pytest.mark.parametrize("wake_in_c", [False, True])
def test_a_recording_in_loops_arrives_whole_and_wakes_once_per_window(live, wake_in_c):
    for _ in range(20):
        with made_ring() as ring:
            woken, task = run(recording(3, live), library_path(), ring, fd=wake_in_c)
            if live and missed(ring) * PERIOD_NS > CATCH_UP.catch_up_ns:
                continue  # a machine that stalls for so long loses samples
            assert ring.written == 3 * SAMPLES and ring.state == ENDED
            np.testing.assert_array_equal(newest(ring), np.arange(3 * SAMPLES - CAPACITY, 3 * SAMPLES) % SAMPLES)
            assert task.windows == 3 * SAMPLES // WINDOW
            # a cycle after a stall completes all windows of the stall and wakes once
            stalled = missed(ring) * PERIOD_NS * RATE * 1e-9 // (WINDOW / 2)
            assert task.windows - stalled <= woken <= task.windows
            return
    raise AssertionError("the machine stalls all the time")


@needs_c
def test_cycles_in_c_are_counted_like_those_in_python(small_ring):
    ring, fd = Ring.create(small_ring.layout)
    run(recording(2), None, ring)
    run(recording(2), library_path(), small_ring, fd=True)
    python, compiled = (CycleStats(each.cycle_slots, PERIOD_NS).summary() for each in (ring, small_ring))
    for summary, each in ((python, ring), (compiled, small_ring)):
        assert 2 * SAMPLES / 40 - 1 < summary.cycles + summary.missed < 2 * SAMPLES / 20  # the last stall may be long
        assert summary.cycles == each.beats == CycleStats(each.cycle_slots, PERIOD_NS).histogram().sum()
        assert summary.min_us <= summary.p50_us <= summary.max_us and 0 < summary.busy < 1
    ring.close()
    os.close(fd)


@needs_c
def test_a_stop_lets_the_window_in_progress_finish(small_ring):
    asked = []

    def interrupted():  # a signal ends the wait in C; without one, the next Python cycle asks
        asked.append(small_ring.written)
        return small_ring.written > 2 * WINDOW

    _, task = run(recording(0, live=True), library_path(), small_ring, interrupted, fd=True)
    assert small_ring.state == STOPPED
    assert task.windows == asked[-1] // WINDOW + 1 or missed(small_ring)
    assert small_ring.written - task.windows * WINDOW < 40 * (1 + missed(small_ring))


@needs_c
def test_a_device_is_asked_in_every_cycle(ring):
    class Device(CountingSource):
        asked = 0

        def exchange(self):
            self.asked += 1

    source = Device()
    source.period_ns = PERIOD_NS
    begun = time.monotonic()
    run(source, library_path(), ring, lambda: time.monotonic() - begun > 0.1, fd=True)
    assert source.asked == ring.beats > 0
    np.testing.assert_array_equal(newest(ring), np.arange(ring.written))
