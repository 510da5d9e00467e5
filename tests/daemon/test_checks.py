"""What `acqd doctor` says of the disk of the database."""

from __future__ import annotations

import errno
import os
import shutil
from pathlib import Path
from types import SimpleNamespace

import pytest

from acqd.daemon.config import Config
from acqd.daemon.disk_check import disk_check


@pytest.mark.parametrize(
    ("free_gb", "keep_days", "state", "days"),
    [
        (3.0, 30.0, "warn", "3.5"),
        (7.0, 5.0, "ok", "8.1"),
        (7.0, 30.0, "warn", "8.1"),
        (30.0, 30.0, "ok", "34.7"),
        (3.0, None, "warn", "3.5"),
        (7.0, None, "ok", "8.1"),
    ],
)
def test_a_week_of_four_channels_needs_six_gigabytes_and_the_days_that_are_kept_must_fit(
    tmp_path, monkeypatch, free_gb, keep_days, state, days
):
    """A row takes at most 100 bytes (tests/storage/test_numbered_rows.py): 25 windows a second, four channels."""
    monkeypatch.setattr(shutil, "disk_usage", lambda _: SimpleNamespace(free=free_gb * 1e9))
    config = Config(sink={"database": str(tmp_path / "a.sqlite"), "keep_days": keep_days})
    found = disk_check(config)
    assert found.state == state and f"rows of 1 device for {days} days" in found.finding
    assert state == "ok" or "a week of rows needs 6 GB, 0.9 GB a day" in found.advice


def test_a_share_that_is_away_ends_no_start(monkeypatch):
    def away(_):
        raise OSError(errno.ESTALE, os.strerror(errno.ESTALE))

    monkeypatch.setattr(shutil, "disk_usage", away)
    found = disk_check(Config(), Path("/shares/a@b/rows.sqlite"))
    assert found.state == "fail" and found.finding == "/shares/a@b: Stale file handle"
