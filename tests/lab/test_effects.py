"""What every effect does to the power, and when."""

import numpy as np
import pinocchio as pin
import pytest

from acqd.lab.effects import known_effects, make_effects, parse_effect
from acqd.lab.instruments.data_recorder import ControllerClock
from acqd.lab.plant import Plant, Stretch
from acqd.motion.controller import Controller, Move, Phase, Wait
from acqd.robot.arm import Arm
from acqd.robot.dynamics import gravity_torque, mechanical_energy
from acqd.robot.kinematics import forward_kinematics
from tests.lab.moved import CELL, CLEAN, IIWA, MOTION, VOLTAGE, power_of, run

MECHANICAL = {
    "coulomb_friction", "viscous_friction", "stribeck_friction", "load_dependent_friction", "thermal_friction",
    "mechanical_power", "copper_loss", "supply_efficiency",
}  # fmt: skip


@pytest.mark.parametrize("name", sorted(MECHANICAL))
def test_losses_never_give_power(name):
    power = run(make_effects([parse_effect(name)], [1]))[1]
    moving = np.abs(MOTION.qd).max(axis=1) > 0.05
    assert (power - CLEAN).mean() > 0.05
    assert (power - CLEAN)[moving].mean() > (power - CLEAN)[~moving].mean()


@pytest.mark.parametrize("name", sorted(set(known_effects()) - {"meter_gain", "meter_saturation"}))
def test_an_effect_does_nothing_before_its_onset_and_scales_with_its_strength(name):
    strength = known_effects()[name].strength[0]
    later = make_effects([parse_effect(f"{name}:from=2")], [1])
    assert np.array_equal(run(later)[1], CLEAN)
    default = known_effects()[name].defaults[strength]
    weak = run(make_effects([parse_effect(f"{name}:{strength}={default / 4}")], [1]))[1] - CLEAN
    strong = run(make_effects([parse_effect(name)], [1]))[1] - CLEAN
    if np.abs(strong).max() > 1e-6:
        assert np.abs(strong).sum() > 2 * np.abs(weak).sum() > 0


def test_an_onset_within_a_recording_is_kept_to_the_millisecond():
    power = run(make_effects([parse_effect("offset_shift:at=3.0")], [1]))[1]
    changed = np.flatnonzero(np.abs(power - CLEAN) > 1e-9)
    assert changed[0] == 3000


def test_brakes_peak_when_they_open():
    power = run(make_effects([parse_effect("brake_release")], [1]), pieces=4)[1] - CLEAN
    opening = np.flatnonzero(np.diff(MOTION.brake_open.astype(int)) == 1)[0]
    assert opening < power.argmax() < opening + 100
    assert power.max() > 150
    assert np.abs(power[: opening - 1]).max() < 1e-9


def test_a_payload_carried_by_the_tool_acts_only_while_it_is_on():
    power = run(make_effects([parse_effect("payload:with_tool=1,mass_kg=3")], [1]))[1]
    on = np.flatnonzero(MOTION.tool_on)
    assert np.abs((power - CLEAN)[: on[0]]).max() < 1e-9
    assert np.abs((power - CLEAN)[on[0] : on[-1]]).max() > 1.0


def test_the_log_of_a_biased_sensor_is_biased():
    plant = Plant(CELL.true_arm, CELL.parameters, make_effects([parse_effect("torque_bias:axis=4,torque_Nm=2")], [1]))
    honest = Plant(CELL.true_arm, CELL.parameters)
    part, voltage = MOTION.part(0, 2000), VOLTAGE[:2000]
    difference = plant.run(part, voltage).recorded.tau - honest.run(part, voltage).recorded.tau
    np.testing.assert_allclose(difference, np.tile([0, 0, 0, 2.0, 0, 0, 0], (2000, 1)), atol=1e-12)


def test_a_turned_base_takes_the_torques_of_an_arm_that_is_described_so():
    """A base on a wall: the description's first joint turned, not another gravity."""
    description = CELL.true_arm.description
    first = description.joint[0]
    upright = pin.rpy.rpyToMatrix(np.radians(first.rpy_deg))
    turn = pin.rpy.rpyToMatrix(np.radians([0.0, 90.0, 0.0]))
    turned = {"xyz": tuple(turn @ first.xyz), "rpy_deg": tuple(np.degrees(pin.rpy.matrixToRpy(turn @ upright)))}
    joints = [first.model_copy(update=turned), *description.joint[1:]]
    q = MOTION.q[::500]
    expected = gravity_torque(Arm(description.model_copy(update={"joint": joints})), q)
    upright_torque, leaning = gravity_torque(CELL.true_arm, q), "mounting:tilt_deg=90,towards_deg=0"
    honest, tilted = (
        Plant(CELL.true_arm, CELL.parameters, make_effects([parse_effect(each)], [1])).run(MOTION, VOLTAGE).recorded.tau
        for each in (leaning.replace("90", "0"), leaning)
    )
    np.testing.assert_allclose((tilted - honest)[::500], expected - upright_torque, atol=1e-6)


@pytest.mark.parametrize("name", ["payload", "gravity_bias", "contact_force", "mounting"])
def test_torque_sensors_feel_what_the_arm_carries(name):
    """They sit after the gear: a weight on the arm is in the log, a friction in the gear is not."""
    honest = Plant(CELL.true_arm, CELL.parameters).run(MOTION, VOLTAGE).recorded.tau
    loaded = Plant(CELL.true_arm, CELL.parameters, make_effects([parse_effect(name)], [1]))
    rubbing = Plant(CELL.true_arm, CELL.parameters, make_effects([parse_effect("viscous_friction")], [1]))
    assert np.abs(loaded.run(MOTION, VOLTAGE).recorded.tau - honest).max() > 0.5
    np.testing.assert_allclose(rubbing.run(MOTION, VOLTAGE).recorded.tau, honest, atol=1e-9)


def test_clock_effects_change_the_clock_from_their_recording_on():
    offset, drift = make_effects([parse_effect("clock_offset:from=3"), parse_effect("clock_drift:from=3")], [1])
    clock = ControllerClock()
    begins = {1: 0.0, 2: 0.0, 3: 5000.0, 4: 5000.0}.__getitem__  # two recordings a session
    assert offset.clock(clock, 2, begins) == drift.clock(clock, 2, begins) == clock
    assert offset.clock(clock, 3, begins).offset_s == 0.2
    faster = drift.clock(clock, 4, begins)
    at = np.array([5000.0, 6000.0])
    np.testing.assert_allclose(faster.reading(at) - at, [0.0, 0.03], atol=1e-9)  # a bend, no jump


def test_pressing_downwards_helps_when_going_up_and_costs_when_going_down():
    """The table pushes the flange up: rising needs less power than without, sinking more."""
    targets = np.radians([[0, 60, 0, -60, 0, 30, 0], [0, 20, 0, -60, 0, 30, 0], [0, 70, 0, -60, 0, 30, 0]])
    motion = Controller(IIWA, np.zeros(7)).run([Phase("contact"), *(Move(target, 0.4, 0.2) for target in targets)])
    rising = np.gradient(forward_kinematics(CELL.arm, motion.q)[0][:, 2], 1e-3)
    pressed = power_of("contact_force:force_N=60", motion, np.full(len(motion), 230.0))
    active = (np.abs(pressed) > 1) & (np.abs(rising) > 0.05)
    assert active.sum() > 100
    assert np.corrcoef(pressed[active], rising[active])[0, 1] < -0.5


def test_a_heavier_link_costs_power_on_the_way_up_and_a_lighter_one_saves_it():
    potential = np.gradient(mechanical_energy(CELL.arm, MOTION.q, 0 * MOTION.q), 1e-3)
    fast = np.abs(potential) > 5
    for order, sign in (("gravity_bias:mass_kg=3", 1), ("gravity_bias:mass_kg=-3", -1)):
        assert sign * np.corrcoef(power_of(order)[fast], potential[fast])[0, 1] > 0.4


def test_higher_voltage_means_more_power_in_proportion():
    volts = np.full(len(MOTION), 230 * 1.02)
    np.testing.assert_allclose(
        power_of("line_voltage:exponent=1", voltage=volts)[1000:] / CLEAN[1000:], 0.02, rtol=0.02
    )
    assert np.abs(power_of("line_voltage:exponent=1", voltage=np.full(len(MOTION), 230.0))).max() < 1e-9


def test_only_power_given_back_is_burnt():
    plant = Plant(CELL.true_arm, CELL.parameters)
    trace = plant.run(MOTION, VOLTAGE)
    given = np.maximum(-trace.situation.joint_power.sum(axis=1), 0)
    extra = power_of("regeneration_clipping")
    assert given.max() > 5
    assert extra.sum() == pytest.approx(given.sum(), rel=0.12)  # and the supply's losses on it
    assert (extra[given.cumsum() == 0] == 0).all()


def test_a_thermostat_is_on_for_its_share_of_its_period():
    motion = Controller(IIWA, np.zeros(7)).run([Wait(90.0)])
    extra = power_of("thermostat:power_W=10,period_s=6,duty=0.3", motion, np.full(len(motion), 230.0))
    assert extra.mean() == pytest.approx(3.0, rel=0.1)
    assert np.diff(extra > 5).sum() == pytest.approx(30, abs=3)


def test_equipment_works_in_bursts_and_in_its_phases():
    motion = Controller(IIWA, np.zeros(7)).run([Wait(300.0)])
    extra = power_of("process_load:power_W=20", motion, np.full(len(motion), 230.0))
    assert 0.1 < (extra > 15).mean() < 0.6
    motion = Controller(IIWA, np.zeros(7)).run([Wait(2.0), Phase("screw"), Wait(3.0), Phase("rest"), Wait(2.0)])
    extra = power_of("process_load:power_W=20", motion, np.full(len(motion), 230.0))
    np.testing.assert_allclose(extra[[1900, 2500, 4900, 5500]], [0, 20, 20, 0], atol=0.1)


@pytest.mark.parametrize("name", ["tool_actuation", "process_load", "contact_force", "thermostat", "brake_release"])
def test_effects_with_a_state_do_not_care_how_motion_is_cut(name):
    whole, pieces = (run(make_effects([parse_effect(name)], [1]), pieces=count)[1] for count in (1, 37))
    assert np.abs(whole - pieces).max() < 0.05


def test_cold_gears_are_cold_when_the_effect_begins():
    later = power_of("thermal_friction:from=2,minutes=0.2", stretch=Stretch(0.0, 2))
    at_once = power_of("thermal_friction:minutes=0.2")
    np.testing.assert_allclose(later, at_once, atol=1e-9)
