"""What `acqd doctor` says of the spool."""

from __future__ import annotations

from acqd.daemon.config import Config
from acqd.daemon.spool_checks import spool_checks


def check(**config):
    (finding,) = spool_checks(Config(**config))
    return finding


def test_a_spool_in_memory_and_one_larger_than_the_disk_are_warnings(tmp_path):
    assert check().state == "warn" and "state_dir" in check().advice
    assert check(state_dir=tmp_path / "new").state == "ok"
    large = check(state_dir=tmp_path, spool={"max_mb": 9e6})
    assert large.state == "warn" and "max_mb" in large.advice
    assert list(tmp_path.iterdir()) == []
    assert not list(spool_checks(Config(mqtt={"enabled": False})))
