"""MAIN_FAST in virtual time."""

from __future__ import annotations

import numpy as np

from acqd.metering import Meter
from acqd.plc.fast import FastTask, OverrunPolicy
from acqd.plc.ring import RUNNING
from acqd.plc.slow import SlowTask
from tests.plc.counting import CountingSource, index_of


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
