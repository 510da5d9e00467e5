"""The spool within its limits: bytes on disk, bytes in memory, and no limit of age."""

from __future__ import annotations

import tracemalloc
from unittest import mock

from acqd.telemetry.spool import Limits, Spool
from acqd.uptime import Moment
from tests.telemetry.spool.rows import STREAMS, everything, window


def test_a_full_spool_drops_the_oldest_counts_and_says_so(tmp_path, caplog):
    caplog.set_level("INFO")
    spool = Spool(tmp_path, Limits(max_bytes=100_000))
    for k in range(1_000):
        spool.append(window(k, 200))
    assert spool.size <= 100_000 and 0 < spool.dropped < 2_000
    rows = everything(spool)
    assert len(rows) == 2_000 - spool.dropped and rows[-1].seq == 999
    assert caplog.text.count("is full: dropping") == 1
    assert "full; when it is full: drop-oldest" in caplog.text
    for stream in STREAMS:
        spool.remove(stream, 0, 998)
    spool.append(window(1_000, 60_000 // 10))
    assert sum(path.stat().st_size for path in tmp_path.glob("*.seg")) <= 110_000


def test_a_full_spool_may_refuse_the_newest(tmp_path):
    spool = Spool(tmp_path, Limits(max_bytes=50_000, when_full="drop-newest"))
    kept = sum(spool.append(window(k, 200)) for k in range(500))
    assert 0 < kept < 500 and spool.dropped == 2 * (500 - kept)
    assert [row.seq for row in everything(spool)][-1] == kept - 1


def test_no_row_goes_for_its_age_and_ages_count_by_a_clock_that_nobody_sets(tmp_path, caplog):
    now = [Moment(b"a" * 16, 10**9)]
    limits = Limits(max_bytes=64 * 4096, max_age_s=100)
    spool = Spool(tmp_path, limits, lambda: now[0])
    for k in range(40):
        spool.append(window(k, 200))
    now[0] = Moment(b"a" * 16, 301 * 10**9)
    with mock.patch("time.time_ns", lambda: 10**9), mock.patch("time.time", lambda: 1.0):
        for k in range(40, 80):
            spool.append(window(k, 200))
        assert spool.age_s == 300 and not spool.dropped and caplog.text.count("have waited") == 1
    spool.close()
    now[0] = Moment(b"a" * 16, 401 * 10**9)
    again = Spool(tmp_path, limits, lambda: now[0])
    assert again.age_s == 400 and len(again) == 160
    again.close()
    now[0] = Moment(b"b" * 16, 50 * 10**9)
    after_a_restart_of_the_computer = Spool(tmp_path, limits, lambda: now[0])
    assert after_a_restart_of_the_computer.age_s == 50 and len(after_a_restart_of_the_computer) == 160


def test_rows_on_disk_cost_next_to_no_memory(tmp_path):
    spool = Spool(tmp_path)
    for k in range(3_000):
        spool.append(window(k, 300))
    tracemalloc.start()
    before = tracemalloc.get_traced_memory()[0]
    for k in range(3_000, 13_000):
        spool.append(window(k, 300))
    grown = tracemalloc.get_traced_memory()[0] - before
    tracemalloc.stop()
    assert spool.size > 6_000_000 and grown < 100_000


def test_rows_in_memory_cost_little_more_than_their_bytes():
    tracemalloc.start()
    spool = Spool(None)
    for k in range(5_000):
        spool.append(window(k, 290))
    used = tracemalloc.get_traced_memory()[0]
    tracemalloc.stop()
    assert used < 1.6 * 10_000 * 350
