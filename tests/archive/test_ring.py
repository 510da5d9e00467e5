"""The oldest samples make room for the newest, all of them for the rows, and no disk stops the metering."""

import errno
import os
import shutil
import threading
from collections import namedtuple
from types import SimpleNamespace

import pytest

from acqd.archive import ring
from acqd.archive.catalogue import contents
from acqd.archive.ring import Limits, Ring
from acqd.archive.segment_file import SegmentFile
from acqd.daemon.config import Config
from acqd.daemon.health.snapshot import Archive
from acqd.daemon.health.verdict import verdict
from tests.archive.box import FakeBox, mains, recorder, until
from tests.archive.test_archive import again
from tests.daemon.health.snapshots import daemon

CODES = mains(1.0)
Usage = namedtuple("Usage", "total used free")


def fed(archive, seconds, device="box"):
    """A box that was fed for so long."""
    box = FakeBox(archive, Config(device=device))
    for k in range(seconds):
        box.feed(CODES, at=k * len(CODES))
        until(lambda: archive.waiting == 0)
    return box


def numbers(root):
    return [segment.head.number for segment in contents(root).segments]


def test_the_oldest_segments_go_when_the_bytes_are_used_up(tmp_path):
    archive = recorder(tmp_path, Limits(300_000, 1e9, 0), segment_s=0.5)
    box = fed(archive, 8)
    box.track.finish()
    archive.close()
    there = numbers(tmp_path)
    assert there == list(range(there[0], there[0] + len(there))) and there[0] > 5
    assert sum(path.stat().st_size for path in tmp_path.glob("*/*.arc")) < 400_000
    report = again(tmp_path, stored=box.rows)
    assert report.comparison.same == report.rows > 0, "rows of what is left are exact without what is gone"


def test_days_are_counted_in_samples_of_each_device(tmp_path):
    archive = recorder(tmp_path, Limits(10**12, 1.5, 0), segment_s=0.5)
    for name in ("one", "two"):
        fed(archive, 4, name).track.finish()
    archive.close()
    for name in ("one", "two"):
        seconds = sum(segment.seconds for segment in contents(tmp_path, name).segments)
        assert 1.0 <= seconds <= 2.6


def test_the_archive_leaves_the_disk_to_the_rows(tmp_path, monkeypatch):
    free, filled = 10**9, 0

    def usage(_):
        files = sum(path.stat().st_size for path in tmp_path.glob("*/*.arc"))
        return Usage(10**12, 0, free if not filled else free - files)

    monkeypatch.setattr(shutil, "disk_usage", usage)
    archive = recorder(tmp_path, Limits(10**12, 1e9, 2 * 10**8), segment_s=0.4)
    box = fed(archive, 3)
    assert len(numbers(tmp_path)) > 4 and not archive.latest.trouble
    free, filled = 10**8, 1
    box.feed(CODES, at=3 * len(CODES))
    until(lambda: archive.latest.trouble and not list(tmp_path.glob("*/*.arc")))  # the archive gives all it has
    assert "kept for the rows" in archive.latest.trouble and len(box.rows) == 400, "rows go on"
    archive.close()


def test_where_deleting_frees_nothing_the_archive_stays(tmp_path, monkeypatch):
    """As with snapshots or hard links."""
    free, now = 10**8, 100.0
    monkeypatch.setattr(shutil, "disk_usage", lambda _: Usage(10**12, 0, free))
    monkeypatch.setattr(ring, "time", SimpleNamespace(monotonic=lambda: now))
    kept = Ring(tmp_path, Limits(10**12, 1e9, 2 * 10**8))
    for number in range(20):
        (tmp_path / f"{number}.arc").write_bytes(b"x")
        kept.add(number, tmp_path / f"{number}.arc")
        kept.update(number, 10**6, 1.0, writing=False)
    for _ in range(50):
        with pytest.raises(OSError, match="frees nothing: snapshots"):
            kept.make_room(0)
    assert kept.deleted == 3
    now += 31.0
    with pytest.raises(OSError, match="frees nothing"):
        kept.make_room(0)
    now += 31.0
    assert not kept.give_up_oldest() and kept.deleted == 4, "the pauses grow"
    free = 10**9
    kept.make_room(0)
    assert kept.deleted == 4


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EIO])
def test_a_disk_that_refuses_is_a_named_problem_and_a_named_gap(tmp_path, monkeypatch, number):
    refuses, whole = threading.Event(), SegmentFile._write

    def write(self, data):
        if refuses.is_set():
            raise OSError(number, os.strerror(number))
        whole(self, data)

    monkeypatch.setattr(SegmentFile, "_write", write)
    monkeypatch.setattr("acqd.archive.recorder._RETRY_S", 0.05)
    archive = recorder(tmp_path)
    box = fed(archive, 1)
    refuses.set()
    box.feed(CODES, at=len(CODES))
    until(lambda: archive.latest.trouble)
    assert os.strerror(number) in archive.latest.trouble
    told = verdict(daemon(archive=Archive("x", trouble=archive.latest.trouble, lost=5)))
    assert any(text.startswith("archive: ") and "rows go on" in text for text in told.problems)
    refuses.clear()
    at = 2 * len(CODES)
    while archive.latest.trouble:
        box.feed(CODES[:4000], at=at)
        at += 4000
        until(lambda: archive.waiting == 0)
    box.feed(CODES, at=at)
    box.track.finish()
    archive.close()
    gaps = contents(tmp_path).gaps()
    if number == errno.EIO:
        assert gaps[-1].samples > 0 and gaps[-1].why == f"disk: {os.strerror(number)}"
    else:
        assert numbers(tmp_path)[0] > 1, "a full disk has had the oldest segments"
    assert len(box.rows) * 200 == at + len(CODES), "not one row is missing"
    report = again(tmp_path, stored=box.rows)
    assert report.comparison.different == 0 and report.comparison.not_archived > 0
    assert report.comparison.same == report.rows > 0


def test_a_disk_that_hangs_costs_samples_and_no_rows(tmp_path, monkeypatch):
    hangs, whole = threading.Event(), SegmentFile.append

    def append(self, blocks):
        hangs.wait()
        whole(self, blocks)

    monkeypatch.setattr(SegmentFile, "append", append)
    monkeypatch.setattr("acqd.archive.recorder._MOST_WAITING", 500_000)
    monkeypatch.setattr("acqd.archive.recorder._RETRY_S", 0.01)
    archive = recorder(tmp_path)
    box = FakeBox(archive)
    for k in range(4):
        box.feed(CODES, at=k * len(CODES))
    assert "too slow" in archive.latest.trouble and archive.latest.lost > 0
    assert len(box.rows) == 400
    hangs.set()
    until(lambda: archive.waiting == 0 and archive.ready)
    box.feed(CODES, at=4 * len(CODES))
    box.track.finish()
    archive.close()
    assert any(gap.why == "the disk was too slow" for gap in contents(tmp_path).gaps())
    assert again(tmp_path, stored=box.rows).comparison.different == 0


def test_a_disk_that_is_away_at_the_start_does_not_keep_the_daemon_from_metering(tmp_path, monkeypatch):
    monkeypatch.setattr("acqd.archive.recorder._RETRY_S", 0.01)
    (tmp_path / "mount").write_text("in the way of the folder")
    archive = recorder(tmp_path / "mount")
    assert archive.latest.trouble
    box = fed(archive, 1)
    assert len(box.rows) == 100 and archive.latest.lost == len(CODES)
    (tmp_path / "mount").unlink()
    until(lambda: archive.ready)
    box.feed(CODES, at=len(CODES))
    box.track.finish()
    archive.close()
    (segment,) = contents(tmp_path / "mount").segments[:1]
    assert segment.head.begins.startswith("disk: ") and segment.head.index == len(CODES)
    assert again(tmp_path / "mount", stored=box.rows).comparison.different == 0


def test_an_event_points_at_its_first_sample(tmp_path):
    """File and offset hold for samples of the segment before, too."""
    archive = recorder(tmp_path)
    box = fed(archive, 2)
    for index in (0, 30_000, 39_990):
        file, sample = box.track.where(index) or ("", -1)
        if not file:
            assert index < 16_000, "only the last two segments are known"
            continue
        segment = next(each for each in contents(tmp_path).segments if f"box/{each.path.name}" == file)
        assert segment.head.index + sample == index
    assert box.track.where(39_990) is not None
    archive.close()
