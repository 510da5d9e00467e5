"""Rows in the spool of another name are named, with the remedy."""

from __future__ import annotations

import pytest

from acqd.telemetry.spool import Spool, SpooledRow, Stream
from acqd.telemetry.spool.left_behind import folder_of, left_behind, strangers


def fill(state_dir, device, rows=3):
    spool = Spool(folder_of(state_dir, device))
    spool.append([SpooledRow(Stream(device, "L1", "b"), k, b"{}") for k in range(rows)])
    return spool


def test_rows_of_a_renamed_device_are_named_with_the_remedy(tmp_path):
    fill(tmp_path, "old").close()
    fill(tmp_path, "new").close()
    text = str(left_behind(tmp_path, "new"))
    assert text.startswith(f"3 rows of device old wait in {tmp_path}/spool-old") and 'device = "old"' in text


def test_rows_of_another_daemon_that_runs_are_not(tmp_path):
    other = fill(tmp_path, "other")
    assert left_behind(tmp_path, "new") is None
    other.close()
    assert left_behind(tmp_path, "new")


def test_a_spool_of_another_name_whose_rows_are_delivered_is_not(tmp_path):
    spool = fill(tmp_path, "old")
    spool.remove(Stream("old", "L1", "b"), 0, 2)
    spool.close()
    (tmp_path / "spool-old" / "0000000000000001 (copy).seg").write_bytes(b"x")
    assert left_behind(tmp_path, "new") is None


def test_copies_among_the_segments_are_named(tmp_path):
    spool, folder = fill(tmp_path, "new"), folder_of(tmp_path, "new")
    assert strangers(folder) is None and strangers(tmp_path / "away") is None
    (folder / "0000000000000001 (copy).seg").write_bytes(b"x")
    (folder / "x.seg").mkdir()
    text = str(strangers(folder))
    assert text.startswith(f"{folder}/0000000000000001 (copy).seg and 1 more is no file of this spool")
    spool.close()


def test_a_spool_of_another_name_that_cannot_be_read_is_named(tmp_path):
    fill(tmp_path, "old").close()
    [path] = (tmp_path / "spool-old").glob("*.seg")
    path.unlink()
    path.symlink_to(path.name)
    assert "cannot be read" in str(left_behind(tmp_path, "new"))


@pytest.mark.parametrize("folder", ["missing", "."])
def test_without_another_spool_there_is_nothing_to_say(tmp_path, folder):
    assert left_behind(tmp_path / folder, "new") is None
