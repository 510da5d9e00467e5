"""The plant: its energy balance, with and without effects."""

import numpy as np
import pytest

from acqd.lab.cell import build_cell
from acqd.lab.effects import known_effects, make_effects, parse_effect
from acqd.lab.plant import Plant
from acqd.lab.settings import LabSettings
from tests.lab.moved import CELL, CLEAN, MOTION, VOLTAGE, motion_of, run
from tests.places import ROOT

PLANTS = sorted(path.stem for path in (ROOT / "acqd" / "lab" / "plants").glob("*.toml"))


@pytest.mark.parametrize("name", PLANTS)
def test_energy_balances_for_every_robot(name):
    cell = build_cell(LabSettings(robot=name))
    motion = motion_of(cell)
    plant = Plant(cell.true_arm, cell.parameters)
    plant.run(motion, np.full(len(motion), 230.0))
    balance = plant.ledger.balance()
    assert balance["unaccounted_share"] < 1e-6
    assert all(energy > 0 for name, energy in balance["dissipated_J"].items() if name != "chopper")


@pytest.mark.parametrize("name", list(known_effects()))
def test_energy_balances_with_every_effect(name):
    plant, _ = run(make_effects([parse_effect(name)], [1]), pieces=3)
    assert plant.ledger.balance()["unaccounted_share"] < 1e-6


def test_the_ledger_notices_what_is_missing():
    """The balance closes because the physics does, not because the ledger makes it."""
    plant = Plant(CELL.true_arm, CELL.parameters)
    rotor = plant._body.rotor_torque
    plant._body.rotor_torque = lambda motion: 1.02 * rotor(motion)  # torque without the inertia to explain it
    fastest = int(np.abs(MOTION.qd).max(axis=1).argmax())
    plant.run(MOTION.part(0, fastest), VOLTAGE[:fastest])
    assert plant.ledger.balance()["unaccounted_share"] > 1e-5


def test_pieces_make_the_same_power_as_the_whole():
    assert np.abs(run(pieces=5)[1] - CLEAN).max() < 5e-3  # gears warm up in steps of a second from each begin


def test_standby_is_that_of_the_thesis_and_motion_takes_more():
    closed = ~MOTION.brake_open
    assert CLEAN[closed][:900].mean() == pytest.approx(155, abs=2)
    assert CLEAN[MOTION.brake_open].mean() > 165


def test_an_effect_at_two_hooks_keeps_the_balance():
    class Both(known_effects()["offset_shift"]):
        def dc_load(self, situation):
            return 5.0 * self.gate(situation)

        def torque(self, situation):
            return 0.5 * np.tanh(situation.motion.qd / 0.01)

    plant, power = run([Both({}, (1, 0.0), np.random.default_rng(0))])
    assert plant.ledger.balance()["unaccounted_share"] < 1e-6
    assert (power - CLEAN)[500] > 12
