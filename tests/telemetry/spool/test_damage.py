"""Torn ends and damaged bytes of the spool cost only the rows that they hit."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path
from unittest import mock

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acqd.telemetry.spool import Limits, Readings, Spool
from tests.telemetry.spool.rows import everything, window


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


def _longer(path):
    with path.open("ab") as file:
        file.write(b"a line of somebody else\n")


@pytest.mark.parametrize(
    "deed", [lambda path: os.truncate(path, 0), lambda path: os.truncate(path, path.stat().st_size // 2), _longer]
)
def test_rows_that_follow_what_somebody_has_done_to_the_open_file_are_kept(tmp_path, deed):
    """A rotation of logs that copies a file and cuts it off, `> FILE`: the rows after it are behind no known offset."""
    spool = Spool(tmp_path)
    for k in range(3):
        spool.append(window(k))
    (path,) = tmp_path.glob("*.seg")
    deed(path)
    for k in range(3, 9):
        spool.append(window(k))
    after = [row for k in range(3, 9) for row in window(k)]
    assert everything(spool)[-len(after) :] == after and spool.deleted == 1
    spool.close()
    assert everything(Spool(tmp_path))[-len(after) :] == after


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
