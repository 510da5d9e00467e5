"""What is in the folder of the spool and is no segment of it stops nothing."""

from __future__ import annotations

import os
import shutil
from unittest import mock

import pytest

from acqd.telemetry.spool import Spool, log
from acqd.telemetry.spool.segment import Segment
from acqd.uptime import Moment
from tests.telemetry.spool.rows import everything, window

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


@pytest.mark.parametrize("copied", [shutil.copy, os.link])
def test_rows_of_a_segment_that_was_copied_to_other_numbers_wait_until_they_are_stored_once(tmp_path, copied):
    spool = Spool(tmp_path)
    spool.append(window(0) + window(1))
    spool.close()
    (path,) = tmp_path.glob("*.seg")
    for number in (5, 6):
        copied(path, tmp_path / f"{number:016d}.seg")
    again = Spool(tmp_path)
    for stream, seq, _ in [*window(0), *window(1)]:
        again.remove(stream, seq, seq)
    assert not len(again) and not everything(again)
    again.close()
    assert not len(Spool(tmp_path))


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
