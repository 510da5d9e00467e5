"""The energy registers on disk."""

from __future__ import annotations

from acqd.daemon.register import RegisterFile, greater


def test_registers_continue_from_the_greater_reading():
    assert greater(None, None, 1) is None
    assert greater([(1.0, 0.0)], None, 1) == [(1.0, 0.0)]
    assert greater([(1.0, 0.5)], [(0.9, 0.6)], 1) == [(1.0, 0.6)]
    assert greater([(1.0, 0.5)], [(5.0, 5.0)] * 3, 1) == [(1.0, 0.5)], "of another number of phases"


def test_a_full_disk_is_said_once(tmp_path, caplog):
    register = RegisterFile(tmp_path / "none", "cell1")
    for _ in range(3):
        register.save([(1.0, 0.0)])
    assert caplog.text.count("cannot be written") == 1
    (tmp_path / "none").mkdir()
    register.save([(1.0, 0.0)])
    assert register.load(1) == [(1.0, 0.0)] and caplog.text.count("cannot be written") == 1
