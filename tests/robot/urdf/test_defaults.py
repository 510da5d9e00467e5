"""The shares behind guessed drives, against the described robots that they come from."""

import numpy as np
import pytest

from acqd.lab.plant.parameters import load_plant
from acqd.robot import load_description
from acqd.robot.urdf import defaults
from acqd.robot.urdf.defaults import Rated, guessed_drive, guessed_friction


def test_the_shares_are_geometric_means_over_the_described_joints():
    shares = {name: [] for name in ("RAMP_S", "ROTOR_SHARE", "COPPER_SHARE", "COULOMB_SHARE", "VISCOUS_SHARE")}
    for name in ("ur3e", "ur10e", "kinova_gen3", "iiwa7_r800"):
        robot = load_description(name)
        friction = load_plant(robot).friction
        drives = [joint.drive for joint in robot.joint]
        shares["RAMP_S"] += list(robot.speed / robot.acceleration)
        shares["ROTOR_SHARE"] += list([d.rotor_inertia_kgm2 for d in drives] * robot.acceleration / robot.effort)
        current = robot.effort / np.array([d.effort_per_ampere for d in drives])
        copper = np.array([d.resistance_Ohm for d in drives]) * current**2
        shares["COPPER_SHARE"] += list(copper / (robot.effort * robot.speed))
        shares["COULOMB_SHARE"] += list(friction.coulomb_Nm / robot.effort)
        shares["VISCOUS_SHARE"] += list(friction.viscous_Nms_rad * robot.speed / robot.effort)
    for name, values in shares.items():
        assert getattr(defaults, name) == pytest.approx(np.exp(np.mean(np.log(values))), rel=0.04), name


@pytest.mark.parametrize(("kind", "ratio"), [("revolute", "gear_ratio"), ("prismatic", "gear_ratio_rad_m")])
def test_a_guessed_drive_has_its_shares(kind, ratio):
    rated = Rated(200.0, 2.0)
    drive, friction = guessed_drive(rated, kind), guessed_friction(rated, kind)
    current = rated.effort / (drive[ratio] * drive["torque_constant_Nm_A"])
    assert drive["resistance_Ohm"] * current**2 == pytest.approx(0.16 * 400, rel=0.01)
    coulomb, viscous = friction.values()
    assert (coulomb, viscous * rated.speed) == pytest.approx((0.057 * 200, 0.19 * 200), rel=0.01)
