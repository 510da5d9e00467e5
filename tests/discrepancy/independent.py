"""What every effect adds to the power, written without the library's own expressions: from the scene's motion alone."""

import numpy as np
from scipy.signal import lfilter

from acqd.discrepancy.regression.setup import Comparison, set_up
from acqd.discrepancy.selection.forward_selection import Limits, select
from acqd.models.effects import library
from acqd.models.effects.substeps import SUBSTEPS, averaged
from acqd.robot import load_description
from acqd.robot.arm import Arm, Payload
from acqd.robot.dynamics import gravity_torque, inverse_dynamics
from tests.builders import STEP, recording


def traced(model, robot, add, *, count=6, rows=500, withheld=frozenset(), contrast=True, only=None):
    """The loop's heart on recordings with an effect, beside recordings without."""
    reference = [recording(model, k, rows=rows, seed=1) for k in range(count)] if contrast else []
    in_question = [recording(model, k, add, rows=rows, seed=2, start_s=1e9 + 5000) for k in range(count)]
    return selected(model, robot, in_question, reference, only or library(), withheld)


def selected(model, robot, in_question, reference, only, withheld=()):
    """The selection on recordings in question and reference recordings."""
    comparison = Comparison(model, robot, in_question, reference, frozenset(only), frozenset(withheld))
    setup = set_up(comparison, lambda _: None)
    return setup.design, select(setup, Limits(), lambda _: None)


def lagged_mean(fine_power, lag_s=0.012, steps=40):
    """[T] rows of power [SUB T] by another way: 40 steps a row, first-order lag by exact exponentials."""
    finer = np.repeat(fine_power, steps // SUBSTEPS)
    keep = np.exp(-STEP / steps / lag_s)
    out, _ = lfilter([1 - keep], [1, -keep], finer, zi=[keep * finer[0]])
    return out.reshape(-1, steps).mean(axis=1)


# What each effect adds, written without the library's own expressions: from the scene's motion alone.
def extra_power(scene, torque):
    """W of a torque on top of the motors', exactly: mechanical, copper, conduction; [T] at the meter."""
    return lagged_mean(extra_at_drives(scene, torque))


def extra_at_drives(scene, torque):
    """[SUB T] W, before the supply's lag."""
    gain, copper, conduction = (scene.model.group(name) for name in ("gain", "copper", "conduction"))

    def power(tau):
        loss = (copper * tau**2 + conduction * (np.sqrt(tau**2 + 0.25) - 0.5)).sum(axis=1)
        return gain[0] * (tau * scene.qd).sum(axis=1) + loss

    return power(scene.tau + torque) - power(scene.tau)


def column(scene, joint, values):
    found = np.zeros_like(scene.qd)
    found[:, joint] = values
    return found


def pulses(scene, random, low, high, gap):
    on = np.zeros(scene.rows)
    k = int(random.exponential(gap / STEP))
    while k < scene.rows:
        length = int(random.uniform(low, high) / STEP)
        on[k : k + length] = 1
        k += length + int(random.exponential(gap / STEP)) + 5
    return on


def payload_torque(scene, kg=2.0):
    arm = load_description("ur10e")
    more = inverse_dynamics(Arm(arm, Payload(kg, (0, 0, 0.05))), scene.q, scene.qd, scene.qdd)
    return more - inverse_dynamics(Arm(arm), scene.q, scene.qd, scene.qdd)


def added_payload(scene, random):
    return extra_power(scene, payload_torque(scene))


def since_release(scene):
    rise = int(np.flatnonzero(np.diff(scene.signals["brake"]) > 0)[0]) + 1
    age = (np.arange(len(scene.q)) - rise) * STEP / SUBSTEPS
    return np.where(age >= 0, age, -0.001)


def thermostat(scene, random):
    return 6.0 * (((averaged(scene.t) + 13.0) % 47.0) < 20.0)


INDEPENDENT = {
    "coulomb_friction": lambda s, r: extra_power(s, column(s, 1, 4.0 * np.tanh(s.qd[:, 1] / 0.004))),
    "viscous_friction": lambda s, r: extra_power(s, column(s, 2, 8.0 * s.qd[:, 2])),
    "stribeck_friction": lambda s, r: extra_power(s, 6.0 * np.exp(-np.abs(s.qd / 0.15) ** 1.7) * np.tanh(s.qd / 0.01)),
    "load_dependent_friction": lambda s, r: extra_power(s, 0.15 * np.abs(s.tau_rigid) * np.tanh(s.qd / 0.004)),
    "thermal_friction": lambda s, r: extra_power(s, column(s, 0, 60 * s.qd[:, 0] * 2.0 ** (-(s.t - 1e9 - 5000) / 150))),
    "payload": added_payload,
    "gravity_bias": lambda s, r: extra_power(
        s, gravity_torque_of_link(s.q, 2, 3.0)
    ),
    "mounting": lambda s, r: extra_power(s, tilted_torque(s.q, 4.0)),
    "joint_zero": lambda s, r: extra_power(s, shifted_torque(s, 1, 0.06)),
    "copper_loss": lambda s, r: lagged_mean(0.9 * (s.model.group("copper") * s.tau**2).sum(axis=1)),
    "mechanical_power": lambda s, r: lagged_mean(0.12 * np.abs(s.tau * s.qd).sum(axis=1)),
    "regeneration_clipping": lambda s, r: lagged_mean(0.9 * np.maximum(-s.drives, 0)),
    "brake_release": lambda s, r: lagged_mean(25.0 * (since_release(s) >= 0) * np.exp(-since_release(s) / 0.15)),
    "brake_holding": lambda s, r: lagged_mean(5.0 * s.signals["brake"]),
    "gear_ripple": lambda s, r: extra_power(s, column(s, 1, 4.0 * np.sin(17.3 * s.q[:, 1] + 0.4))),
    "thermostat": thermostat,
    "tool_actuation": lambda s, r: lagged_mean(4.0 * s.signals["tool"]),
    "line_voltage": lambda s, r: s.predicted * ((s.volts / 230.0) ** 2.5 - 1),
    "supply_efficiency": lambda s, r: 6.0 * (s.predicted / 100.0) ** 2,
    "contact_force": lambda s, r: pulses(s, r, 1.5, 4, 8) * lagged_mean(contact_power(s, 40.0)),
    "meter_gain": lambda s, r: 0.03 * s.predicted,
    "meter_saturation": lambda s, r: -0.9 * np.maximum(s.predicted - 1.45 * 124.0, 0),
    "process_load": lambda s, r: 7.0 * pulses(s, r, 2, 6, 9),
    "offset_shift": lambda s, r: np.full(s.rows, 4.0),
}  # fmt: skip


def gravity_torque_of_link(q, link, kg):
    return gravity_torque(Arm(with_heavier_link(link, kg)), q) - gravity_torque(Arm(load_description("ur10e")), q)


def mass_torque_of_link(scene, link, kg):
    """Nm of a point mass at the centre of mass of a link, with its inertia."""
    arms = Arm(with_heavier_link(link, kg)), Arm(load_description("ur10e"))
    more, usual = (inverse_dynamics(arm, scene.q, scene.qd, scene.qdd) for arm in arms)
    return more - usual


def tilted_torque(q, degrees):
    """Nm of a base that is tilted so that the arm leans towards its x axis."""
    arm, usual = Arm(load_description("ur10e")), gravity_torque(Arm(load_description("ur10e")), q)
    arm.model.gravity.linear = 9.81 * np.array([np.sin(np.radians(degrees)), 0, -np.cos(np.radians(degrees))])
    return gravity_torque(arm, q) - usual


def shifted_torque(scene, joint, rad):
    """Nm of a joint that stands elsewhere than its logged angle says."""
    arm = Arm(load_description("ur10e"))
    there = inverse_dynamics(arm, scene.q + rad * (np.arange(scene.axes) == joint), scene.qd, scene.qdd)
    return there - inverse_dynamics(arm, scene.q, scene.qd, scene.qdd)


def with_heavier_link(link, kg):
    robot = load_description("ur10e")
    joints = list(robot.joint)
    heavier = joints[link].link.model_copy(update={"mass": joints[link].link.mass + kg})
    joints[link] = joints[link].model_copy(update={"link": heavier})
    return robot.model_copy(update={"joint": joints})


def contact_power(scene, newton):
    arm = load_description("ur10e")
    weight = gravity_torque(Arm(arm, Payload(1.0)), scene.q) - gravity_torque(Arm(arm), scene.q)
    return -(scene.power_per_torque * weight / 9.81 * newton).sum(axis=1)


COMMON = {"payload", "coulomb_friction", "offset_shift", "copper_loss", "clock_offset", "brake_holding"}
