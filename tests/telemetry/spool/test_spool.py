"""The spool: what it holds after restarts, kills and receipts in any order."""

from __future__ import annotations

import errno
import json
import math
import shutil
import signal
import struct
import subprocess
import sys
import tempfile
from pathlib import Path
from unittest import mock

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acqd.errors import UserError
from acqd.telemetry.spool import Limits, Readings, Spool, SpooledRow, Stream, confirm
from acqd.telemetry.spool.record import Window, energy_record, index_record, row_record
from acqd.telemetry.spool.segment import Segment
from tests.telemetry.spool.rows import STREAMS, everything, window


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


def test_recalled_rows_wait_after_a_restart_too_whatever_had_a_receipt_when_their_file_was_closed(tmp_path):
    spool = Spool(tmp_path, Limits(max_bytes=400_000, keep_s=1000.0))
    for k in range(500):
        spool.append(window(k))
        for stream in STREAMS:
            spool.remove(stream, k, k)
    sent = [row for k in range(500) for row in window(k)]
    assert spool.recall("s", "1") == len(sent)
    spool.close()
    again = Spool(tmp_path, Limits(max_bytes=400_000, keep_s=1000.0))
    assert not again.recall("s", "1") and everything(again) == sent


def test_rows_are_recalled_once_for_each_event_of_a_sink_also_after_a_restart(tmp_path):
    def waiting_after(*events):
        spool = Spool(tmp_path, Limits(keep_s=1000.0))
        found = []
        for event in events:
            found.append(spool.recall(*event))
            for stream in STREAMS:
                spool.remove(stream, 0, 9)
        spool.close()
        return found

    spool = Spool(tmp_path, Limits(keep_s=1000.0))
    spool.append(window(0))
    spool.close()
    few = len(STREAMS)
    assert waiting_after(("s", "1"), ("s", "1"), ("t", "1"), ("s", "2")) == [0, 0, few, few]
    assert waiting_after(("s", "2"), ("t", "1"), ("s", "1"), ("", "")) == [0, 0, few, few]
    for content in (b"", b"[1]", b'{"s":', b"\xff"):  # what cannot be read costs no more than rows that come twice
        (tmp_path / "recalls.json").write_bytes(content)
        assert waiting_after(("s", "2"), ("s", "2")) == [few, 0]
    spool = Spool(tmp_path)
    for k in range(100):
        spool.recall(f"{k}", "1")
    spool.close()
    assert len(json.loads((tmp_path / "recalls.json").read_text())) == 64


@pytest.mark.parametrize("keep_s", [0.0, 1e-9])
def test_a_delivered_segment_that_the_disk_does_not_let_go_is_deleted_later(tmp_path, keep_s, monkeypatch, caplog):
    spool = Spool(tmp_path, Limits(max_bytes=400_000, keep_s=keep_s))
    monkeypatch.setattr("acqd.telemetry.spool.kept._RETRY_S", 0.0)
    with mock.patch.object(Path, "unlink", side_effect=OSError(errno.EPERM, "Operation not permitted")):
        for k in range(300):
            spool.append(window(k))
            for stream in STREAMS:
                spool.remove(stream, k, k)
        left = set(tmp_path.glob("0*"))
        assert len(left) > 1 and caplog.text.count("cannot be deleted: Operation not permitted") == len(left) - 1
    for k in range(300, 600):
        spool.append(window(k))
        for stream in STREAMS:
            spool.remove(stream, k, k)
    assert not left & set(tmp_path.glob("0*"))
    spool.close()


def test_registers_belong_to_devices_and_those_of_an_older_spool_to_the_only_one(tmp_path):
    other = Stream("cell2", "L1", "boot1")
    spool = Spool(tmp_path)
    spool.append(window(1), Readings([(1.0, 0.0)]))
    spool.append([SpooledRow(other, 1, b"row")], Readings([(2.0, 0.5)], [3.0]))
    spool.close()
    again = Spool(tmp_path)
    after = Window("boot1", 1)
    assert again.readings("cell1") == ([(1.0, 0.0)], None, after)
    assert again.readings("cell2") == ([(2.0, 0.5)], [3.0], after)
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
