"""What a crash leaves: everything but the record that was being written, and a gap that says why."""

import shutil

import numpy as np
import pytest

from acqd.archive.catalogue import contents
from acqd.archive.repair import repair
from acqd.archive.segment import Segment
from acqd.archive.verify import verified
from tests.archive.box import UTC, FakeBox, mains, recorder, until
from tests.archive.test_archive import again

CODES = mains(1.2)


@pytest.fixture(scope="module")
def living(tmp_path_factory):
    """An archive as it lies on disk while a daemon writes its second segment, and the box that it belongs to."""
    root = tmp_path_factory.mktemp("living")
    archive = recorder(root / "archive")
    box = FakeBox(archive)
    box.feed(CODES)
    until(lambda: archive.waiting == 0)
    shutil.copytree(root / "archive", root / "crashed")
    box.track.finish()
    archive.close()
    return root / "crashed", box


def crashed(living, tmp_path):
    """A copy, and its open segment."""
    folder = tmp_path / "a"
    shutil.copytree(living[0], folder)
    return folder, sorted(folder.glob("box/*.arc"))[-1]


@pytest.mark.parametrize("damage", ["none", "torn", "zeros", "garbage", "to the head"])
def test_whole_records_survive_and_what_follows_is_cut(living, tmp_path, damage):
    folder, path = crashed(living, tmp_path)
    before = Segment.open(path)
    assert before.why is None and len(before.chunks) >= 3
    data = path.read_bytes()
    third = before.chunks[2].offset
    left = {
        "none": data,
        "torn": data[: third + 1000],
        "zeros": data[:third] + bytes(len(data) - third),
        "garbage": data[:third] + np.random.default_rng(1).bytes(7000),
        "to the head": data[: before.chunks[0].offset],
    }[damage]
    path.write_bytes(left)
    archive = recorder(folder)  # opens and repairs
    after = Segment.open(path)
    whole = {"none": len(before.chunks), "to the head": 0}.get(damage, 2)
    assert (after.why, after.torn, after.damaged) == ("torn", 0, 0)
    assert after.chunks == before.chunks[:whole] and not verified(after).faults
    next_box = FakeBox(archive, boot="b1")
    next_box.feed(CODES[:4000], utc=UTC + 90 * 10**9)
    next_box.track.finish()
    archive.close()
    gap = contents(folder).gaps()[-1]
    assert "killed, crashed, or without power" in gap.why and gap.samples is None
    report = again(folder, stored=[*living[1].rows, *next_box.rows])
    assert report.comparison.different == 0 and report.comparison.same == report.rows


def test_a_file_that_never_got_its_head_is_put_aside(living, tmp_path):
    folder, path = crashed(living, tmp_path)
    path.write_bytes(path.read_bytes()[:100])
    recorder(folder).close()
    assert not path.exists() and path.with_suffix(".damaged").stat().st_size == 100
    path.with_suffix(".damaged").rename(folder / "box" / "000000099-20260101T000000Z.arc")
    assert repair(folder / "box" / "000000099-20260101T000000Z.arc") is None


def test_damage_in_the_middle_keeps_the_rest_and_is_named(living, tmp_path):
    folder, path = crashed(living, tmp_path)
    path.unlink()
    (path,) = folder.glob("box/*.arc")
    segment, data = Segment.open(path), bytearray(path.read_bytes())
    data[segment.chunks[1].offset + 500] ^= 1
    path.write_bytes(data)
    assert "checksum" in verified(Segment.open(path)).faults[0]
    path.write_bytes(data[:-40])  # without its index the file is scanned: the damaged record is no record any more
    assert Segment.open(path).damaged > 0
    (gap,) = contents(folder).gaps()
    assert gap.why == "damaged bytes in the file" and gap.samples == segment.chunks[1].samples
    report = again(folder, stored=living[1].rows)
    assert report.comparison.different == 0, "rows after the damage are not made up"
    assert report.notes and "rest of this segment" in report.notes[0]


def test_a_reader_beside_the_writer_sees_whole_records_only(living):
    assert all(place.samples for segment in contents(living[0]).segments for place in segment.chunks)
    assert again(living[0], stored=living[1].rows).comparison.different == 0
