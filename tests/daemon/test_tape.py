"""The tape: what is on it has been made, whatever happens to the daemon."""

from __future__ import annotations

import json
import os

import pytest

from acqd.daemon.tape import Tape
from acqd.errors import UserError
from tests.storage.rows import row
from tests.telemetry.rows import some_rows


def test_rows_are_on_the_tape_as_they_are_published_and_a_second_start_appends(tmp_path):
    _, _, rows = some_rows(seconds=0.2)
    for half in (rows[:8], rows[8:]):
        Tape(tmp_path / "tape").write(half)
    lines = (tmp_path / "tape").read_bytes().splitlines()
    assert lines == [one.to_json() for one in rows] and json.loads(lines[0])["seq"] == 0


def test_a_file_that_cannot_be_opened_is_refused(tmp_path):
    with pytest.raises(UserError, match="--tape"):
        Tape(tmp_path / "no folder" / "tape")


def test_a_full_disk_is_said_once_and_costs_no_row_elsewhere(tmp_path, caplog, monkeypatch):
    tape = Tape(tmp_path / "tape")
    write = os.write

    def full(_fd, _data):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "write", full)
    tape.write([row()])
    tape.write([row()])
    monkeypatch.setattr(os, "write", write)
    tape.write([row()])
    assert len(caplog.messages) == 2 and "No space left" in caplog.messages[0]
