"""A disk that does not give rows out now is waited for; no row is given up for it."""

from __future__ import annotations

import errno
import os
from pathlib import Path
from unittest import mock

import pytest

from acqd.telemetry.spool import Limits, Spool, segment
from acqd.telemetry.spool.segment import Segment
from tests.telemetry.spool.rows import STREAMS, everything, window


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


def _delivered(folder):
    """A spool whose rows are all delivered, in kept files and the newest one."""
    spool = Spool(folder, Limits(max_bytes=400_000, keep_s=1000.0))
    for k in range(500):
        spool.append(window(k))
    for stream in STREAMS:
        spool.remove(stream, 0, 499)
    return spool, [row for k in range(500) for row in window(k)]


def test_rows_that_a_database_lacks_are_read_once_the_disk_gives_them_out(tmp_path, caplog):
    spool, sent = _delivered(tmp_path)
    disk = Unreadable(errno.EIO)
    with mock.patch.object(segment.os, "pread", disk), mock.patch.object(spool._backoff, "pause_s", lambda: 0.0):
        assert spool.recall() == 0 and "Input/output error" in spool.reading_trouble
        for k in range(500, 900):  # other files begin and end meanwhile
            spool.append(window(k))
            for stream in STREAMS:
                spool.remove(stream, k, k)
        assert not spool.readable_again()
        disk.error = 0
        assert spool.readable_again() and everything(spool)[: len(sent)] == sent and not spool.reading_trouble
        assert not spool.readable_again()


def test_a_kept_file_that_a_person_deletes_is_no_trouble(tmp_path):
    spool, sent = _delivered(tmp_path)
    gone = len(min(tmp_path.glob("*.kept")).read_bytes())
    min(tmp_path.glob("*.kept")).unlink()
    assert 0 < len(sent) - spool.recall() < gone and not spool.reading_trouble and not spool.readable_again()


@pytest.mark.parametrize(("error", "kept"), [(errno.EIO, True), (errno.EROFS, True), (errno.ENOSPC, False)])
def test_kept_rows_go_for_room_and_for_no_other_error(tmp_path, error, kept):
    spool, sent = _delivered(tmp_path)
    failure = OSError(error, os.strerror(error))
    with mock.patch.object(segment.os, "write", side_effect=failure):
        spool.append(window(500))
        assert spool.trouble
    assert (spool.recall() == len(sent)) is kept


def test_a_file_that_cannot_be_renamed_is_kept_all_the_same(tmp_path):
    refused = OSError(errno.EROFS, os.strerror(errno.EROFS))
    with mock.patch.object(Path, "rename", side_effect=refused):
        spool, sent = _delivered(tmp_path)
        assert spool.recall() == len(sent) and everything(spool) == sent
