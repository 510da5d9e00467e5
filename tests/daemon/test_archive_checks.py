"""What `acqd doctor` says about the disk of the archive."""

import shutil
from collections import namedtuple

import pytest

from acqd.daemon.archive_checks import archive_checks
from acqd.daemon.config import Config

Usage = namedtuple("Usage", "total used free")


def checked(monkeypatch, free_gb, state_dir=None, **section):
    monkeypatch.setattr(shutil, "disk_usage", lambda _: Usage(0, 0, int(free_gb * 1e9)))
    return list(archive_checks(Config(state_dir=state_dir, archive={"enabled": True, **section})))


def test_the_ring_is_compared_with_the_disk(tmp_path, monkeypatch):
    assert not list(archive_checks(Config(state_dir=tmp_path)))
    (finding,) = checked(monkeypatch, 500, tmp_path, max_gb=80.0)
    assert finding.state == "ok" and "6.7 days" in finding.finding
    (finding,) = checked(monkeypatch, 50, tmp_path, max_gb=80.0)
    assert finding.state == "warn" and "room for 48 GB" in finding.advice
    (finding,) = checked(monkeypatch, 500, tmp_path, max_gb=80.0, keep_free_gb=0.5)
    assert finding.state == "warn" and "spool" in finding.advice
    (finding,) = checked(monkeypatch, 500)
    assert finding.state == "fail" and "state_dir" in finding.advice


def test_meters_have_no_samples_to_keep():
    meters = {"kind": "meters", "host": "x", "meters": [{"name": "a", "unit": 1, "profile": "sdm630"}]}
    with pytest.raises(ValueError, match="have no samples"):
        Config(source=meters, archive={"enabled": True})
