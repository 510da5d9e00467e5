"""The energy registers on disk."""

from __future__ import annotations

from acqd.daemon.register import RegisterFile, greater, registers_of


def test_registers_continue_from_the_greater_reading():
    assert greater(None, None, 1) is None
    assert greater([(1.0, 0.0)], None, 1) == [(1.0, 0.0)]
    assert greater([(1.0, 0.5)], [(0.9, 0.6)], 1) == [(1.0, 0.6)]
    assert greater([(1.0, 0.5)], [(5.0, 5.0)] * 3, 1) == [(1.0, 0.5)], "of another number of phases"


def test_reactive_energy_and_demand_are_kept_beside_and_damage_costs_only_them(tmp_path, caplog):
    registers = registers_of(1, 0.04, 0.0, None)
    registers.channels["L1"].reactive[3] = 1.5
    RegisterFile(tmp_path, "cell1").save([(1.0, 0.0)], registers.state())
    file = RegisterFile(tmp_path, "cell1")
    assert file.load(1) == [(1.0, 0.0)]
    assert registers_of(1, 0.04, 0.0, file.others).reading("L1")["W_reactive_IV"] == 1.5
    assert registers_of(3, 0.04, 0.0, file.others).reading("L1")["W_reactive_IV"] == 0.0
    assert "start from zero" in caplog.text


def test_a_full_disk_is_said_once(tmp_path, caplog):
    register = RegisterFile(tmp_path / "none", "cell1")
    for _ in range(3):
        register.save([(1.0, 0.0)])
    assert caplog.text.count("cannot be written") == 1
    (tmp_path / "none").mkdir()
    register.save([(1.0, 0.0)])
    assert register.load(1) == [(1.0, 0.0)] and caplog.text.count("cannot be written") == 1
