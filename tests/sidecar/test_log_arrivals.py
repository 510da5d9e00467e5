"""Files that are written while one looks, in virtual time."""

import os

import pytest

from acqd.sidecar import log_arrivals as module
from acqd.sidecar.log_arrivals import Arrivals


class Clock:
    """Both clocks of the module `time`; they stand still unless a test moves them."""

    now = 1_700_000_000.0

    def monotonic(self):
        return self.now

    def time(self):
        return self.now

    def stamp(self, path):
        """The file was written now."""
        os.utime(path, (self.now, self.now))


@pytest.fixture
def clock(monkeypatch):
    clock = Clock()
    monkeypatch.setattr(module, "time", clock)
    return clock


def test_half_written_files_are_waited_for(tmp_path, clock):
    arrivals = Arrivals(tmp_path, settle_s=0.2)
    path = tmp_path / "a.log"
    path.write_text("time,q1\n1,2")
    clock.stamp(path)
    (tmp_path / ".a.log.part").write_text("x\n")
    for _ in range(4):
        clock.now += 0.1
        assert list(arrivals.look()) == []  # ends within a line
    with path.open("a") as file:
        file.write("\n")
    clock.stamp(path)
    assert list(arrivals.look()) == []
    assert arrivals.waiting()
    clock.now += 0.3
    assert list(arrivals.look()) == [path]
    assert list(arrivals.look()) == []
    path.unlink()
    assert list(arrivals.look()) == [] and not arrivals.waiting()


def test_an_empty_file_is_waited_for_longer(tmp_path, clock):
    arrivals = Arrivals(tmp_path, settle_s=0.2)
    empty = tmp_path / "b.log"
    empty.touch()
    clock.stamp(empty)
    assert list(arrivals.look()) == [] and arrivals.waiting()  # somebody is about to write it
    os.utime(empty, (clock.now - 60, clock.now - 60))
    assert list(arrivals.look()) == [empty]
