"""Full disks, shares that are away and folders that are gone: rows wait in memory, and are said."""

from __future__ import annotations

import errno
import os
import shutil
from contextlib import suppress
from pathlib import Path
from unittest import mock

import pytest

from acqd.errors import UserError
from acqd.telemetry.spool import Limits, Readings, Spool, log, segment
from tests.telemetry.spool.rows import everything, window


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


def test_rows_of_a_folder_that_is_moved_away_go_where_the_next_start_looks(tmp_path):
    folder = tmp_path / "spool"
    spool = Spool(folder)
    for k in range(20):
        spool.append(window(k))
    folder.rename(tmp_path / "moved")
    spool.append(window(20))
    assert everything(spool) == [row for k in range(21) for row in window(k)]
    spool.close()
    assert spool.deleted == 1
    assert everything(Spool(folder)) == [row for k in range(21) for row in window(k)]


def test_another_spools_file_of_the_same_size_is_not_taken_for_ones_own(tmp_path):
    folder, theirs = tmp_path / "spool", b"another one's"
    spool = Spool(folder)
    spool.append(window(0))
    (path,) = folder.glob("*.seg")
    head, size = path.read_bytes()[:8], path.stat().st_size
    folder.rename(tmp_path / "hidden")
    folder.mkdir()
    path.write_bytes((head + theirs).ljust(size, b"x"))
    spool.close()
    assert spool.deleted == 1 and theirs in path.read_bytes()
    assert everything(Spool(folder)) == window(0)


@pytest.fixture
def mounted_over(tmp_path):
    """A spool with twenty windows, and what puts a folder with files of the same numbers in the place of its own."""
    earlier = Spool(tmp_path / "other")
    for k in range(100, 115):
        earlier.append(window(k))
    earlier.close()
    spool = Spool(tmp_path / "spool", Limits(keep_s=600.0))
    for k in range(20):
        spool.append(window(k))

    def mount():
        (tmp_path / "spool").rename(tmp_path / "hidden")
        (tmp_path / "other").rename(tmp_path / "spool")

    return spool, mount


def test_a_share_that_is_mounted_over_the_folder_gets_the_rows_behind_its_files(mounted_over, tmp_path):
    spool, mount = mounted_over
    mount()
    for k in range(20, 30):
        spool.append(window(k))
    assert not spool.trouble and spool.deleted == 1
    spool.close()
    again = everything(Spool(tmp_path / "spool"))
    assert again == [row for k in [*range(100, 115), *range(30)] for row in window(k)]


def test_files_of_another_spool_are_neither_sent_nor_deleted_for_ones_own(mounted_over, tmp_path):
    spool, mount = mounted_over
    with mock.patch.object(segment.os, "write", side_effect=OSError(errno.ESTALE, os.strerror(errno.ESTALE))):
        spool.append(window(20))  # the file before is closed
    mount()
    with mock.patch("acqd.telemetry.spool.log._DISK_RETRY_S", 0.0):
        spool._log._retry_at = 0.0
        spool.append(window(21))
    assert everything(spool) == [*window(20), *window(21)]
    assert "another file of a spool" in spool.reading_trouble and len(spool) == 2 * 22
    for stream, last, _ in window(21):
        spool.remove(stream, 0, last)  # receipts for all, the rows that cannot be read included
    spool.close()
    assert everything(Spool(tmp_path / "spool")) == [row for k in range(100, 115) for row in window(k)]


def test_a_file_that_somebody_lays_where_the_next_one_goes_stays_and_rows_go_behind_it(tmp_path):
    spool = Spool(tmp_path)
    spool.append(window(0))
    theirs = tmp_path / f"{spool._log.next_number:016d}.seg"
    theirs.write_bytes(b"theirs")
    with mock.patch.object(segment.os, "write", side_effect=OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))):
        spool.append(window(1))
    with mock.patch("acqd.telemetry.spool.log._DISK_RETRY_S", 0.0):
        spool._log._retry_at = 0.0
        spool.append(window(2))
    assert not spool.trouble and theirs.read_bytes() == b"theirs"
    spool.close()
    assert everything(Spool(tmp_path)) == [row for k in range(3) for row in window(k)]


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


def _deleted_folder(spool, folder):
    shutil.rmtree(folder)


def _deleted_files(spool, folder):
    for path in folder.iterdir():
        path.unlink()


def _deleted_reserve(spool, folder):
    (folder / "reserve").unlink()
    while spool.segments < 2:  # the next file begins
        spool.append(window(10_000 + spool.accepted, 700))


@pytest.mark.parametrize("deed", [_deleted_folder, _deleted_files, _deleted_reserve])
def test_what_a_person_deletes_is_set_aside_again_for_a_stop_on_a_full_disk(tmp_path, deed):
    folder = tmp_path / "spool"
    spool = Spool(folder, Limits(max_bytes=100_000))
    spool.append(window(0))
    deed(spool, folder)
    spool.append(window(1))
    kept = everything(spool)
    with _full_but_for(folder / "reserve"):
        spool.append(window(2))
        assert spool.trouble and spool.close() == 0
    assert everything(Spool(folder)) == kept + window(2)


def test_a_start_on_a_full_disk_sets_blocks_aside_when_there_is_room(tmp_path, caplog):
    with mock.patch("acqd.telemetry.spool.log._DISK_RETRY_S", 0.0):
        with _full_but_for(None), mock.patch.object(os, "posix_fallocate", _half):
            spool = Spool(tmp_path)
            assert not (tmp_path / "reserve").stat().st_size, "what room there is, rows need"
            for k in range(3):
                spool.append(window(k))
        spool.append(window(3))
    assert caplog.text.count("sets nothing aside") == 1
    with _full_but_for(tmp_path / "reserve"):
        spool.append(window(4))
        assert spool.close() == 0
    assert everything(Spool(tmp_path)) == [row for k in range(5) for row in window(k)]


def _half(file, offset, size):
    """posix_fallocate on a disk without room for all: the file is longer all the same, as on ext4."""
    os.ftruncate(file, size // 2)
    raise OSError(errno.ENOSPC, "No space left on device")


def _full_but_for(reserve):
    """A disk that takes bytes only where they have been set aside."""
    real, set_aside = os.write, os.stat(reserve).st_ino if reserve is not None else None
    full = FullDisk(0)
    return mock.patch.object(
        segment.os, "write", lambda f, d: real(f, d) if os.fstat(f).st_ino == set_aside else full(f, d)
    )


def test_a_stop_says_how_many_rows_no_disk_has_taken(tmp_path):
    spool = Spool(tmp_path)
    (tmp_path / "reserve").unlink()
    with mock.patch.object(segment.os, "write", FullDisk(0)):
        spool.append(window(0))
        assert spool.close() == 2


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
