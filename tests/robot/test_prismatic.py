"""Prismatic joints: against a hand derivation, Pinocchio, MuJoCo; their keys."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acqd.errors import InputError
from acqd.models.effects.bodies import point_mass
from acqd.robot.arm import Arm, Payload
from acqd.robot.description import LogColumns
from acqd.robot.dynamics import (
    gravity_torque,
    inertial_parameters,
    inverse_dynamics,
    payload_parameters,
    payload_regressor,
    regressor,
)
from acqd.robot.kinematics import Pose, forward_kinematics, inverse_kinematics
from acqd.robot.log_reader import read_log
from acqd.robot.newton_euler import Chain, joint_torque
from tests.robot.sliding import SLIDE, link, robot, scara, slide, turn
from tests.robot.states import states
from tools.common import mujoco_oracle

number = st.floats(-3, 3, allow_nan=False)


@settings(max_examples=40, deadline=None)
@given(number, number, number, number, number, st.floats(0.1, 20), st.floats(0.1, 5), st.floats(0.1, 2))
def test_a_cart_with_a_pendulum_moves_as_lagrange_says(x, angle, speed, rate, change, cart, bob, length):
    """Point mass `bob` at `length` below a cart on rails along x; the pendulum turns about y."""
    swinging = link(bob, (0, 0, -length), (0,) * 6)
    made = robot(slide("rail", [1, 0, 0], link(cart)), turn("pendulum", [0, 1, 0], swinging))
    accelerate = 0.7
    motion = [np.array([pair]) for pair in ((x, angle), (speed, rate), (accelerate, change))]
    force, torque = joint_torque(Chain.of(made), inertial_parameters(Arm(made)), *motion)[0]
    # place of the bob: (x - l sin a, -l cos a); Lagrange's equations
    sine, cosine = np.sin(angle), np.cos(angle)
    along = (cart + bob) * accelerate - bob * length * (change * cosine - rate**2 * sine)
    about = bob * length**2 * change - bob * length * accelerate * cosine + bob * 9.81 * length * sine
    assert force == pytest.approx(along, abs=1e-9)
    assert torque == pytest.approx(about, abs=1e-9)


def test_numpy_pinocchio_and_mujoco_agree():
    made = scara()
    arm, motion = Arm(made), states(made)
    pinocchios = inverse_dynamics(arm, *motion)
    own = joint_torque(Chain.of(made), inertial_parameters(arm), *motion)
    np.testing.assert_allclose(own, pinocchios, atol=1e-10)
    np.testing.assert_allclose(mujoco_oracle.inverse_dynamics(mujoco_oracle.build(made), *motion), own, atol=1e-9)
    np.testing.assert_allclose(regressor(arm, *motion) @ inertial_parameters(arm), own, atol=1e-10)
    payload = Payload(1.3, (0.02, 0.01, 0.05))
    added = inverse_dynamics(Arm(made, payload), *motion) - own
    np.testing.assert_allclose(payload_regressor(made, *motion) @ payload_parameters(payload), added, atol=1e-10)


def test_frames_and_weights_follow_the_slide():
    made = scara()
    q, _, _ = states(made, 40)
    heavier = gravity_torque(Arm(made, Payload(1.0)), q) - gravity_torque(Arm(made), q)
    bodies = np.zeros((4, 10))
    bodies[3] = point_mass(Chain.of(made).beyond_flange(0.0))
    np.testing.assert_allclose(joint_torque(Chain.of(made), bodies.ravel(), q, 0 * q, 0 * q), heavier, atol=1e-10)
    for ours, theirs in zip(
        forward_kinematics(Arm(made), q), mujoco_oracle.flange(mujoco_oracle.build(made), q), strict=True
    ):
        np.testing.assert_allclose(ours, theirs, atol=1e-9)


def test_inverse_kinematics_does_not_turn_metres():
    gantry = robot(
        *(slide(name, axis, link(1), limits_m=[5, 12]) for name, axis in zip("xyz", np.eye(3).tolist(), strict=True))
    )
    wanted = np.array([11.0, 6.5, 9.0])
    places, turns = forward_kinematics(Arm(gantry), wanted[None])
    found = inverse_kinematics(
        Arm(gantry), Pose(places[0], turns[0]), np.full(3, 5.0), np.random.default_rng(1), restarts=3
    )
    assert found is not None
    np.testing.assert_allclose(found, wanted, atol=1e-6)


def test_limits_of_a_slide_are_metres():
    made = scara()
    assert made.sliding == (2,)
    np.testing.assert_allclose(made.upper, [np.pi, np.pi, 1, np.pi])
    np.testing.assert_allclose(made.speed, [np.pi / 2, np.pi / 2, 1, np.pi / 2])
    assert made.effort.tolist() == [50, 50, 500, 50]


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        ({"limits_deg": [-1, 1]}, "limits_deg is no key of a prismatic joint; write limits_m"),
        ({"drive": {**SLIDE, "gear_ratio": 3}}, "drive.gear_ratio is no key of a prismatic joint"),
        ({"friction": {"coulomb_N": 3}}, "friction.viscous_Ns_m is missing"),
        ({"limits_m": [1, -1]}, r"expected \[lower, upper\]"),
        ({"guessed": ["drive.gear_ratio"]}, "guessed names 'drive.gear_ratio', which is no key of this joint"),
        ({"axis": [0, 0, 0]}, "an axis needs a direction"),
    ],
)
def test_a_wrong_key_of_a_slide_is_named(change, complaint):
    with pytest.raises(ValueError, match=complaint):
        robot(slide(**({"name": "z", "axis": [0, 0, 1], "body": link(1)} | change)))


def test_a_log_in_millimetres_is_refused(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("time,q1,q2,q3,q4\n0,0,0,500,0\n1,0,0,501,0\n")
    with pytest.raises(InputError, match="j3 reaches 501 m, but its limit is 1 m; write metres"):
        read_log(path, scara())


LAYOUT = {
    "format": "csv", "row_s": 0.1, "q": "{joint} [mm]", "lengths": "mm", "power": ["Px", "Py"], "power_unit_W": 1e3,
}  # fmt: skip


def machine(speed_m_s=1.0, **layout):
    axes = [slide(name, axis, link(20), speed_m_s=speed_m_s) for name, axis in (("x", [1, 0, 0]), ("y", [0, 1, 0]))]
    return robot(*axes).model_copy(update={"log": [LogColumns.model_validate(LAYOUT | layout)]})


def drawn(row):
    return 400.0 * np.sin(0.02 * row), 300.0 * np.cos(0.03 * row)


def test_rows_without_a_time_in_mm_with_kilowatts_of_each_drive_are_read(tmp_path):
    path = tmp_path / "log.csv"
    rows = [f"{row},{drawn(row)[0]:.6f},{drawn(row)[1]:.6f},0.25,0.5" for row in range(300)]
    path.write_text("\n".join(["number,x [mm],y [mm],Px,Py", *rows, ""]))
    log = read_log(path, machine())
    np.testing.assert_allclose(log.time, 0.1 * np.arange(300))
    np.testing.assert_allclose(log.q, np.array([drawn(row) for row in range(300)]) / 1000, atol=1e-9)
    np.testing.assert_allclose(log.power, 750.0)
    with pytest.raises(InputError, match="x reaches"):
        read_log(path, machine(lengths="m"))
    assert read_log(path, machine(power=["Px", "Pz"])).power is None


@pytest.mark.parametrize("other", [{"time": "t"}, {"time_s": "s", "time_ns": "ns"}, {"columns": ["time", "q"]}])
def test_rows_with_a_time_and_a_distance_are_refused(other):
    with pytest.raises(ValueError, match="expected either row_s or time"):
        machine(**other)


def test_a_slide_that_is_elsewhere_within_a_row_is_refused(tmp_path):
    """Blocks of rows out of order: a tenth of a metre is no rounding."""
    path = tmp_path / "log.csv"
    blocks = np.random.default_rng(3).permutation(np.arange(600).reshape(-1, 20), axis=0).ravel()
    rows = [f"{drawn(row)[0] / 4:.4f},{drawn(row)[1] / 4:.4f},0.25,0.5" for row in blocks]
    path.write_text("\n".join(["x [mm],y [mm],Px,Py", *rows, ""]))
    with pytest.raises(InputError, match=r"moves .* m in 0\.100 s, its limit is 0\.02 m/s"):
        read_log(path, machine(speed_m_s=0.02))
