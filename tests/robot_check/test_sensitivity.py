"""Influences on the predicted power: against hand derivations on one joint."""

import numpy as np
import pytest

from acqd.robot import load_description
from acqd.robot_check.check import check_description
from acqd.robot_check.excitation import STEP_S, excitation
from acqd.robot_check.sensitivity import sensitivity
from tests.robot.sliding import SLIDE, link, robot, scara, slide


@pytest.mark.parametrize("description", [scara(), load_description("fr3")])
def test_the_motion_stays_within_the_described_limits_and_uses_them(description):
    q = excitation(description)
    assert (q.max(axis=0) <= description.upper + 1e-9).all()
    assert (q.min(axis=0) >= description.lower - 1e-9).all()
    speed = np.abs(np.diff(q, axis=0)).max(axis=0) / STEP_S
    assert (speed <= 0.8 * description.speed + 1e-9).all()
    assert (speed > 0.1 * description.speed).all()


def test_a_level_slide_of_one_mass_has_the_power_of_its_friction():
    friction = {"coulomb_N": 40, "viscous_Ns_m": 100}
    drive = SLIDE | {"resistance_Ohm": 1e-6}  # no copper loss
    keys = {"friction": friction, "drive": drive, "guessed": ["friction.viscous_Ns_m"]}
    rail = robot(slide("rail", [1, 0, 0], link(30), **keys))
    found = sensitivity(rail)
    q = excitation(rail)[:, 0]
    v = (q[2:] - q[:-2]) / (2 * STEP_S)
    change = {each.key: each for each in found.influences}
    viscous, coulomb = change["friction.viscous_Ns_m"], change["friction.coulomb_N"]
    assert (viscous.guessed, viscous.factor, coulomb.guessed, coulomb.factor) == (True, 2.0, False, 1.1)
    # 1.05 is the gain from joint to mains of the grey box's prior
    assert viscous.change_W == pytest.approx(1.05 * 100 * np.sqrt((v**4).mean()), rel=0.05)
    assert coulomb.change_W == pytest.approx(1.05 * 4 * np.sqrt((v**2).mean()), rel=0.05)
    assert found.influences == sorted(found.influences, key=lambda each: -each.change_W)


def test_undescribed_friction_counts_as_guessed():
    rail = robot(slide("rail", [1, 0, 0], link(30)))
    checked = check_description(rail)
    assert checked.guesses == {"rail": ["friction (not described)"]}
    assert {each.key for each in checked.guessed_influences} == {"friction.coulomb_N", "friction.viscous_Ns_m"}
    assert checked.as_json()["power"]["mean_W"] > 0


def test_guesses_that_decide_the_power_are_a_doubt():
    friction = {"coulomb_N": 40, "viscous_Ns_m": 100}
    drive = SLIDE | {"resistance_Ohm": 1e-6}
    guessed, known = (
        check_description(robot(slide("rail", [1, 0, 0], link(30), friction=friction, drive=drive, guessed=keys)))
        for keys in (["friction.viscous_Ns_m", "friction.coulomb_N"], [])
    )
    assert guessed.guesses_matter and f"{len(guessed.guessed_influences)} guessed values" in guessed.doubt
    assert not known.guesses_matter and known.doubt == "" and known.as_json()["guessed_W"] == 0
