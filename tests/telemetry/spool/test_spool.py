"""The spool: what it holds after kills, torn writes, full disks and receipts in any order."""

from __future__ import annotations

import errno
import math
import os
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
import tracemalloc
from contextlib import suppress
from pathlib import Path
from unittest import mock

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acqd.errors import UserError
from acqd.telemetry.spool import Limits, Readings, Spool, SpooledRow, Stream, confirm, log, segment
from acqd.telemetry.spool.record import energy_record, index_record, row_record
from acqd.telemetry.spool.segment import Segment
from acqd.uptime import Moment

STREAMS = [Stream("cell1", channel, "boot1") for channel in ("L1", "total")]


def window(k, size=40):
    return [SpooledRow(stream, k, b"%d:" % k + b"x" * size) for stream in STREAMS]


def everything(spool):
    rows, position = [], spool.start
    while position != spool.end:
        some, position = spool.read(position, 7, lambda stream, seq: True)
        rows += some
    return rows


def test_rows_come_back_in_order_and_after_a_restart(tmp_path):
    spool = Spool(tmp_path, Limits(max_bytes=200_000))
    sent = [row for k in range(500) for row in window(k)]
    for k in range(500):
        spool.append(window(k), Readings([(0.001 * k, 0.5)], [float(k), math.nan]))
    assert spool.segments > 3 and everything(spool) == sent and len(spool) == 1000
    spool.close()
    again = Spool(tmp_path, Limits(max_bytes=200_000))
    assert everything(again) == sent and again.readings("cell1").energy == [(0.499, 0.5)]
    assert again.readings("cell1").registers[0] == 499.0 and math.isnan(again.readings("cell1").registers[1])
    assert not again.damaged_bytes
    again.append(window(500))
    assert everything(again) == sent + window(500)


def test_only_one_daemon_uses_a_spool(tmp_path):
    spool = Spool(tmp_path)
    with pytest.raises(UserError, match="another acqd"):
        Spool(tmp_path)
    spool.close()
    Spool(tmp_path).close()


@mock.patch("os.fsync", lambda file: None)
@mock.patch("os.fdatasync", lambda file: None)
def test_a_torn_end_costs_only_the_torn_row_at_every_byte(tmp_path, size=20):
    spool = Spool(tmp_path / "whole")
    for k in range(3):
        spool.append(window(k, size), Readings([(float(k), 0.0)]))
    (path,) = (tmp_path / "whole").glob("*.seg")
    data = path.read_bytes()
    (tmp_path / "torn").mkdir()
    torn = tmp_path / "torn" / path.name
    kept_before = 0
    for end in range(len(data) + 1):
        torn.write_bytes(data[:end])
        opened = Spool(tmp_path / "torn")
        rows = everything(opened)
        assert rows == [row for k in range(3) for row in window(k, size)][: len(rows)]
        assert len(rows) >= kept_before
        kept_before = len(rows)
        opened.append(window(9, size))
        assert everything(opened) == rows + window(9, size)
        opened.close()
        for file in (tmp_path / "torn").glob("*.seg"):
            file.unlink()
    assert kept_before == 6


@given(at=st.integers(16, 1200), garbage=st.binary(min_size=1, max_size=80), closed=st.booleans())
@settings(max_examples=60)
def test_damage_in_the_middle_costs_only_the_rows_it_hits(at, garbage, closed):
    with tempfile.TemporaryDirectory() as folder:
        spool = Spool(Path(folder))
        for k in range(10):
            spool.append(window(k, 30))
        (path,) = Path(folder).glob("*.seg")
        data = bytearray(path.read_bytes())
        if closed:
            spool.close()
            data = bytearray(path.read_bytes())
        hit = range(at, min(at + len(garbage), len(data)))
        data[hit.start : hit.stop] = garbage[: len(hit)]
        copy = Path(folder) / "copy"
        copy.mkdir()
        (copy / path.name).write_bytes(data)
        opened = Spool(copy)
        rows = everything(opened)
        sent = [row for k in range(10) for row in window(k, 30)]
        assert [row for row in sent if row in rows] == rows, "in order, nothing invented"
        assert len(rows) >= len(sent) - len(garbage) // 50 - 2
        assert len(opened) == len(rows), "what cannot be read is given up, not kept for ever"
        opened.close()


_receipt = st.tuples(st.sampled_from(STREAMS), st.integers(0, 90), st.integers(0, 20))
_step = st.one_of(st.just("append"), st.just("reopen"), st.just("kill"), _receipt)


@given(st.lists(_step, max_size=60))
@settings(max_examples=40)
def test_the_spool_holds_exactly_what_was_appended_and_not_receipted(steps):
    """A receipt before a kill may be forgotten (the row is then sent twice), a row never."""
    with tempfile.TemporaryDirectory() as folder:
        path, limits = Path(folder), Limits(max_bytes=1_000_000)
        with mock.patch("acqd.telemetry.spool.spool._SEGMENT", 4096):
            spool = Spool(path, limits)
            count, done = 0, set()
            for step in steps:
                if step == "append":
                    for _ in range(5):
                        spool.append(window(count, 200))
                        count += 1
                elif isinstance(step, tuple):
                    stream, first, more = step
                    removed = spool.remove(stream, first, first + more)
                    fresh = {(stream, k) for k in range(first, first + more + 1) if k < count} - done
                    assert removed == len(fresh)
                    done |= fresh
                else:
                    if step == "reopen":
                        spool.close()
                        after = Spool(path, limits)
                    else:
                        copy = Path(folder) / "killed"
                        shutil.copytree(path, copy, ignore=shutil.ignore_patterns("killed"))
                        spool.close()
                        after = Spool(copy, limits)
                        path, keep = copy, path
                        for file in keep.glob("*.seg"):
                            file.unlink()
                        folder = str(path)
                    spool = after
                    there = {(row.stream, row.seq) for row in everything(spool)}
                    sent = {(stream, k) for stream in STREAMS for k in range(count)}
                    assert sent - done <= there <= sent
                    done = sent - there
            rows = [(row.stream, row.seq) for row in everything(spool)]
            assert set(rows) == {(stream, k) for stream in STREAMS for k in range(count)} - done
            assert [seq for _, seq in rows] == sorted(seq for _, seq in rows) and len(spool) == len(rows)
            spool.close()


def test_a_full_spool_drops_the_oldest_counts_and_says_so(tmp_path, caplog):
    caplog.set_level("INFO")
    spool = Spool(tmp_path, Limits(max_bytes=100_000))
    for k in range(1_000):
        spool.append(window(k, 200))
    assert spool.size <= 100_000 and 0 < spool.dropped < 2_000
    rows = everything(spool)
    assert len(rows) == 2_000 - spool.dropped and rows[-1].seq == 999
    assert (
        caplog.text.count("90 % full") + caplog.text.count("9% full") >= 0
        and caplog.text.count("is full: dropping") == 1
    )
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


class Unreadable:
    """os.pread that fails while `error` is set, for the files whose offsets and sizes a spool asks for."""

    def __init__(self, error):
        self.error = error
        self._pread = os.pread

    def __call__(self, file, size, offset):
        if self.error:
            raise OSError(self.error, os.strerror(self.error))
        return self._pread(file, size, offset)


@pytest.mark.parametrize("error", [errno.EIO, errno.ESTALE, errno.ENOMEM])
def test_a_disk_that_does_not_give_rows_out_is_waited_for_and_costs_no_row(tmp_path, caplog, error):
    spool, sent = Spool(tmp_path, Limits(max_bytes=200_000)), [row for k in range(500) for row in window(k)]
    for k in range(500):
        spool.append(window(k))
    disk, files = Unreadable(error), sorted(tmp_path.glob("*.seg"))
    with mock.patch.object(segment.os, "pread", disk), mock.patch.object(spool._backoff, "pause_s", lambda: 0.0):
        assert everything(spool) == [] and len(spool) == 1000 and sorted(tmp_path.glob("*.seg")) == files
        assert os.strerror(error) in spool.reading_trouble and not spool.dropped
        assert spool.readable_again() and everything(spool) == []
        disk.error = 0
        assert spool.readable_again() and everything(spool) == sent and not spool.reading_trouble
    assert caplog.text.count("cannot be read") == 1 and caplog.text.count("can be read again") == 1


def test_damage_is_not_judged_by_a_disk_that_does_not_answer(tmp_path):
    """Bytes that are wrong are read once more before rows are given up."""
    spool = Spool(tmp_path, Limits(max_bytes=200_000))
    for k in range(50):
        spool.append(window(k))
    [path] = tmp_path.glob("*.seg")
    data = path.read_bytes()
    path.write_bytes(data[:400] + b"x" * 200 + data[600:])
    away = OSError(errno.EIO, os.strerror(errno.EIO))
    with mock.patch.object(Segment, "lose_unreadable", side_effect=away):
        spool.read(spool.start, 1_000, lambda stream, seq: True)
        assert len(spool) == 100 and not spool.dropped and "Input/output error" in spool.reading_trouble
    with mock.patch.object(segment.time, "monotonic", lambda: 1e12), mock.patch.object(spool._backoff, "pause_s", int):
        assert spool.readable_again()
        rows = everything(spool)
    assert 90 < len(rows) == len(spool) < 100 and not spool.reading_trouble


def test_no_descriptor_left_is_no_damage(tmp_path):
    spool = Spool(tmp_path)
    spool.append(window(0))
    with mock.patch.object(Path, "open", side_effect=OSError(errno.EMFILE, os.strerror(errno.EMFILE))):
        assert everything(spool) == [] and len(spool) == 2
    assert "Too many open files" in spool.reading_trouble


def test_a_start_waits_for_files_that_cannot_be_read_and_meters_without_them_if_need_be(tmp_path):
    spool = Spool(tmp_path)
    spool.append(window(0))
    spool.close()
    disk = Unreadable(errno.EIO)
    with mock.patch.object(segment.os, "pread", disk), mock.patch("acqd.telemetry.spool.log._OPENING_S", 0.0):
        again = Spool(tmp_path)
        again._backoff.pause_s = lambda: 0.0
        again.append(window(1))
        assert everything(again) == [] and "cannot be opened" in again.reading_trouble
        disk.error = 0
        again._open_at = 0.0
        assert again.readable_again() and everything(again) == window(0) + window(1)
    assert not again.reading_trouble


FOREIGN = ["0000000000000001 (copy).seg", "x.seg", "1.seg", "00000000000000001.seg", f"{'9' * 19}.seg", "dir"]


@pytest.mark.parametrize("name", FOREIGN)
def test_foreign_files_in_the_folder_stop_nothing_and_stay(tmp_path, name):
    spool = Spool(tmp_path)
    spool.append(window(0))
    spool.close()
    (path,) = tmp_path.glob("*.seg")
    foreign = tmp_path / (name if name != "dir" else "0000000000000007.seg")
    foreign.mkdir() if name == "dir" else shutil.copy(path, foreign)
    again = Spool(tmp_path)
    assert everything(again) == window(0)
    for k in range(1, 9):
        again.append(window(k, 5000))
    again.close()
    assert foreign.exists() and len(Spool(tmp_path)) == len(again) > len(window(0))


def pipe(path):
    os.mkfifo(path)


def device(path):
    path.symlink_to("/dev/zero")


def terabyte(path):
    with path.open("wb") as file:
        file.truncate(1 << 40)


@pytest.mark.parametrize("make", [pipe, device, terabyte])
def test_what_has_the_name_of_a_segment_and_is_none_is_waited_for_and_stops_nothing(tmp_path, make):
    spool = Spool(tmp_path)
    spool.append(window(0))
    spool.close()
    odd = tmp_path / "0000000000000007.seg"
    make(odd)
    with mock.patch.object(log, "_OPENING_S", 0.0):
        again = Spool(tmp_path)
    again.append(window(1))
    assert everything(again) == window(0) + window(1) and odd in again._log.unopened and os.path.lexists(odd)


def test_numbers_beyond_sixteen_digits_are_segments_and_other_digits_are_none(tmp_path):
    (tmp_path / f"{10**16 - 1}.seg").write_bytes(Segment.create(None, 1, Moment(bytes(16), 0)).read(0, 1 << 20))
    foreign = tmp_path / ("\u0660" * 15 + "\u0669.seg")
    foreign.write_bytes(b"x")
    spool = Spool(tmp_path)
    spool.append(window(0))
    spool.close()
    assert everything(Spool(tmp_path)) == window(0) and foreign.exists()


def test_a_damaged_file_is_put_aside_and_not_deleted(tmp_path):
    spool = Spool(tmp_path, Limits(max_bytes=200_000))
    for k in range(200):
        spool.append(window(k))
    first = sorted(tmp_path.glob("*.seg"))[0]
    first.write_bytes(first.read_bytes()[:16] + b"\0" * 200 + b"x" * (first.stat().st_size - 216))
    rows = everything(spool)
    assert rows and len(rows) == len(spool) == 400 - spool.dropped and spool.dropped
    assert not first.exists() and first.with_suffix(".damaged").exists()
    spool.close()
    assert everything(Spool(tmp_path)) == rows


def test_the_folder_is_made_again_and_the_rows_of_the_open_file_survive(tmp_path, caplog):
    folder = tmp_path / "spool"
    spool = Spool(folder)
    for k in range(20):
        spool.append(window(k))
    shutil.rmtree(folder)
    for k in range(20, 30):
        spool.append(window(k))
    spool.close()
    assert spool.deleted == 1
    assert everything(Spool(folder)) == [row for k in range(30) for row in window(k)]
    assert "is made again" in caplog.text


@pytest.mark.parametrize("rows", [1, 300, 2_500])
def test_a_stop_on_a_full_disk_leaves_the_rows_in_memory_in_blocks_that_were_set_aside(tmp_path, rows):
    disk = FullDisk(50_000)
    with mock.patch("acqd.telemetry.spool.log._DISK_RETRY_S", 0.0):
        spool = Spool(tmp_path, Limits(max_bytes=10_000_000))
        reserve = tmp_path / "reserve"
        assert reserve.stat().st_blocks * 512 >= 4 << 20
        set_aside = os.stat(reserve).st_ino
        real = os.write
        with mock.patch.object(
            segment.os, "write", lambda f, d: real(f, d) if os.fstat(f).st_ino == set_aside else disk(f, d)
        ):
            for k in range(rows):
                spool.append(window(k, 700), Readings([(float(k), 0.0)]))
            assert spool.close() == 0
    again = Spool(tmp_path)
    assert everything(again) == [row for k in range(rows) for row in window(k, 700)]
    assert again.readings("cell1").energy == [(rows - 1.0, 0.0)] and reserve.exists()


def test_a_stop_says_how_many_rows_no_disk_has_taken(tmp_path):
    spool = Spool(tmp_path)
    (tmp_path / "reserve").unlink()
    with mock.patch.object(segment.os, "write", FullDisk(0)):
        spool.append(window(0))
        assert spool.close() == 2


def test_delivered_rows_are_kept_for_a_while_and_wait_again_when_they_are_recalled(tmp_path):
    limits = Limits(max_bytes=400_000, keep_s=1000.0)
    spool = Spool(tmp_path, limits)
    for k in range(500):
        spool.append(window(k))
    for stream in STREAMS:
        spool.remove(stream, 0, 450)
    assert (
        len(spool) == 98
        and list(tmp_path.glob("*.kept"))
        and everything(spool) == [row for k in range(451, 500) for row in window(k)]
    )
    assert spool.recall() == 902 and everything(spool) == [row for k in range(500) for row in window(k)]
    for stream in STREAMS:
        spool.remove(stream, 0, 499)
    for k in range(500, 4_000):
        spool.append(window(k))
        for stream in STREAMS:
            spool.remove(stream, k, k)
        assert sum(path.stat().st_size for path in tmp_path.glob("0*")) <= 430_000
    spool.close()
    again = Spool(tmp_path, Limits(max_bytes=400_000, keep_s=0.0))
    assert len(again) <= 200, "what was kept does not wait after a restart"
    again.append(window(4_000, 25_000))
    again.append(window(4_001, 25_000))
    assert not list(tmp_path.glob("*.kept"))


class FullDisk:
    """os.write that takes `room` more bytes, then has no space."""

    def __init__(self, room):
        self.room = room
        self._write = os.write

    def __call__(self, file, data):
        if self.room <= 0:
            raise OSError(errno.ENOSPC, "No space left on device")
        part = data[: self.room]
        self.room -= len(part)
        return self._write(file, part)


@pytest.mark.parametrize("room", [0, 1, 333, 5_000])
def test_a_full_disk_is_survived_said_once_and_left_again(tmp_path, caplog, room):
    disk = FullDisk(room)
    with mock.patch.object(segment.os, "write", disk), mock.patch("acqd.telemetry.spool.log._DISK_RETRY_S", 0.0):
        spool = Spool(tmp_path, Limits(max_bytes=10_000_000))
        for k in range(50):
            spool.append(window(k, 200))
        assert spool.trouble == "No space left on device"
        assert everything(spool) == [row for k in range(50) for row in window(k, 200)]
        disk.room = 10**9
        spool.append(window(50, 200))
    assert not spool.trouble and not spool.dropped
    sent = [row for k in range(51) for row in window(k, 200)]
    assert everything(spool) == sent
    assert caplog.text.count("the disk takes no rows") == 1 and caplog.text.count("takes rows again") == 1
    spool.close()
    assert everything(Spool(tmp_path)) == sent


def test_a_disk_that_stays_full_costs_the_oldest_rows_and_no_memory(tmp_path):
    disk = FullDisk(60_000)
    limits = Limits(max_bytes=1_000_000, memory_bytes=200_000)
    with mock.patch.object(segment.os, "write", disk), mock.patch("acqd.telemetry.spool.log._DISK_RETRY_S", 0.0):
        spool = Spool(tmp_path, limits)
        for k in range(3_000):
            spool.append(window(k, 200))
        held = sum(len(row.payload) for row in everything(spool))
        assert held < 400_000 and spool.dropped and everything(spool)[-1].seq == 2_999
        assert len(everything(spool)) + spool.dropped == 6_000


def test_registers_belong_to_devices_and_those_of_an_older_spool_to_the_only_one(tmp_path):
    other = Stream("cell2", "L1", "boot1")
    spool = Spool(tmp_path)
    spool.append(window(1), Readings([(1.0, 0.0)]))
    spool.append([SpooledRow(other, 1, b"row")], Readings([(2.0, 0.5)], [3.0]))
    spool.close()
    again = Spool(tmp_path)
    assert again.readings("cell1") == ([(1.0, 0.0)], None) and again.readings("cell2") == ([(2.0, 0.5)], [3.0])
    again.close()
    path = tmp_path / "0000000000000009.seg"
    with_index = tmp_path / "0000000000000010.seg"
    old = struct.pack("<8sQ", b"ACQDSPL1", 1) + row_record(other.encoded(), 2, b"row") + energy_record("", [(7.0, 0.0)])
    path.write_bytes(old)
    index = index_record(b'{"streams": [["cell2", "L1", "boot1", [[2, 2]]]], "energy": [[8.0, 0.25]]}')
    with_index.write_bytes(old + index + struct.pack("<8sI", b"ACQDEND1", len(old)))
    assert Segment.open(path).energy == {"": [(7.0, 0.0)]} and Segment.open(with_index).energy == {"": [(8.0, 0.25)]}


def test_a_killed_process_loses_no_row_that_it_has_appended(tmp_path):
    program = (
        "import sys\nfrom pathlib import Path\nfrom acqd.telemetry.spool import Readings, Spool\n"
        "from tests.telemetry.spool.test_spool import window\n"
        f"spool = Spool(Path({str(tmp_path)!r}))\n"
        "for k in range(10**9):\n    spool.append(window(k), Readings([(float(k), 0.0)], [float(k)]))\n"
        "    print(k, flush=True)\n"
    )
    process = subprocess.Popen([sys.executable, "-c", program], stdout=subprocess.PIPE, text=True)
    last = [int(process.stdout.readline()) for _ in range(300)][-1]
    process.send_signal(signal.SIGKILL)
    process.communicate()
    spool = Spool(tmp_path)
    rows = everything(spool)
    assert rows == [row for k in range(len(rows) // 2) for row in window(k)] and rows[-1].seq >= last
    assert spool.readings("cell1").energy[0][0] >= last
    assert spool.readings("cell1").registers[0] == spool.readings("cell1").energy[0][0]


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


def test_what_was_written_is_confirmed_once(tmp_path):
    spool = Spool(tmp_path)
    spool.append(window(0))
    (path,) = tmp_path.glob("*.seg")
    assert spool.unconfirmed() == {path, tmp_path} and spool.unconfirmed() == set()
    spool.append(window(1))
    changed = spool.unconfirmed()
    assert changed == {path}
    path.unlink()
    confirm(changed | {tmp_path})


def test_rows_in_memory_move_to_the_disk_at_the_end_where_it_takes_them(tmp_path):
    disk = FullDisk(0)
    with mock.patch.object(segment.os, "write", disk):
        spool = Spool(tmp_path)
        spool.append(window(0))
        disk.room = 10**6
        spool.close()
    assert everything(Spool(tmp_path)) == window(0)


class Away:
    """Calls on an open file that fail with `error` while it is set, as on a share whose server is away."""

    def __init__(self, *names):
        self.error, self._real = 0, {name: getattr(os, name) for name in names}

    def __enter__(self):
        for name in self._real:
            setattr(segment.os, name, self._answer(name))
        return self

    def __exit__(self, *_):
        for name, real in self._real.items():
            setattr(segment.os, name, real)

    def _answer(self, name):
        def answer(*args, **names):
            done = self._real[name](*args, **names) if name == "close" or not self.error else None
            if self.error:
                raise OSError(self.error, os.strerror(self.error))
            return done

        return answer


@pytest.mark.parametrize("error", [errno.ESTALE, errno.EDQUOT, errno.EROFS])
def test_a_share_that_is_away_stops_no_row_whichever_call_says_so(tmp_path, error):
    with Away("fstat", "write", "ftruncate", "close") as share, mock.patch.object(log, "_DISK_RETRY_S", 0.0):
        spool = Spool(tmp_path)
        for k in range(9):
            share.error = error if 3 <= k < 6 else 0
            spool.append(window(k))
            assert bool(spool.trouble) == bool(share.error)
        share.error = error
        with suppress(OSError):
            spool.close()
    assert everything(spool) == [row for k in range(9) for row in window(k)] and not spool.deleted


def test_what_an_attempt_leaves_that_the_disk_does_not_delete_is_no_obstacle(tmp_path):
    disk = FullDisk(50)
    with mock.patch.object(segment.os, "write", disk), mock.patch.object(log, "_DISK_RETRY_S", 0.0):
        spool = Spool(tmp_path)
        with mock.patch.object(Path, "unlink", side_effect=OSError(errno.EIO, "Input/output error")):
            spool.append(window(0))
        assert spool.trouble and len(list(tmp_path.glob("*.seg"))) == 1
        disk.room = 10**6
        spool.append(window(1))
        spool.close()
    assert not spool.trouble and everything(Spool(tmp_path)) == window(0) + window(1)


def test_rows_on_a_disk_that_is_read_only_are_sent(tmp_path):
    spool, real = Spool(tmp_path), os.open
    spool.append(window(0))
    spool.close()

    def read_only(path, flags, *mode, **names):
        if flags & (os.O_RDWR | os.O_CREAT):
            raise OSError(errno.EROFS, os.strerror(errno.EROFS))
        return real(path, flags, *mode, **names)

    with mock.patch.object(log.os, "open", read_only):
        again = Spool(tmp_path)
        again.append(window(1))
        assert everything(again) == window(0) + window(1) and again.trouble == "Read-only file system"
        with pytest.raises(UserError, match="in use"):
            Spool(tmp_path)
