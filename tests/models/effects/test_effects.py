"""The library of effects and the motion that they see."""

from dataclasses import replace

import numpy as np

from acqd.models.effects import library
from acqd.models.effects.effect import effect_rows, effect_rows_at
from acqd.models.effects.scene import scene_of, segment_scene
from acqd.models.effects.substeps import SUBSTEPS, substep_motion
from acqd.models.greybox.model import GreyBox
from acqd.robot.newton_euler import rotation_of
from tests.builders import STEP, recording, term

DESIGN_IDS = {
    "offset_shift",
    "coulomb_friction",
    "viscous_friction",
    "stribeck_friction",
    "load_dependent_friction",
    "thermal_friction",
    "payload",
    "gravity_bias",
    "copper_loss",
    "mechanical_power",
    "regeneration_clipping",
    "brake_release",
    "brake_holding",
    "gear_ripple",
    "thermostat",
    "tool_actuation",
    "line_voltage",
    "supply_efficiency",
    "contact_force",
    "clock_offset",
    "clock_drift",
    "meter_gain",
    "meter_saturation",
    "process_load",
    "mounting",
    "joint_zero",
}


def test_the_library_has_every_id_of_the_design():
    assert set(library()) == DESIGN_IDS
    for effect in library().values():
        assert effect.summary and effect.equation and effect.experiment
        assert set(effect.neighbours) <= DESIGN_IDS - {effect.id}


def test_fine_motion_is_that_of_a_smooth_curve():
    t = np.arange(-2, 52) * STEP
    fine_t = (np.arange(50 * SUBSTEPS) + 0.5) / SUBSTEPS * STEP - STEP / 2
    q, qd, qdd = substep_motion(np.sin(2 * t)[:, None], STEP)
    assert np.abs(q[:, 0] - np.sin(2 * fine_t)).max() < 1e-6
    assert np.abs(qd[:, 0] - 2 * np.cos(2 * fine_t)).max() < 1e-4
    assert np.abs(qdd[:, 0] + 4 * np.sin(2 * fine_t)).max() < 1e-3


def test_a_heavy_payload_takes_what_a_model_with_that_body_takes(model):
    """Copper loss goes with the square of torque: exact, not to first order, and against the rigid body itself."""
    kg, reach = 6.0, 0.07
    x, y, z = model.chain.beyond_flange(reach)
    body = kg * np.array([1, x, y, z, y * y + z * z, -x * y, x * x + z * z, -x * z, -y * z, x * x + y * y])
    values = model.values.copy()
    inertial = model.layout.part("inertial")
    values[inertial.stop - 10 : inertial.stop] += body
    loaded = GreyBox(model.chain, model.layout, values, STEP, np.ones(1))
    segment = recording(model, 2, seed=9)
    scene = scene_of(model, segment.q, segment.signals, segment.start_s, segment.channels)
    with_body = scene_of(loaded, segment.q, segment.signals, segment.start_s, segment.channels)
    payload = term("payload", {"centre_of_mass_m": reach}, kg)
    np.testing.assert_allclose(payload.rows(scene), with_body.predicted - scene.predicted, atol=1e-6)


def test_a_turned_base_takes_what_a_model_with_that_base_takes(model):
    """The rigid body with another base, not the effect's own columns: exact for any angle."""
    turn = rotation_of((-35.0, 25.0, 0.0))
    chain = model.chain
    turned = replace(
        chain,
        xyz=np.concatenate([chain.xyz[:1] @ turn.T, chain.xyz[1:]]),
        rotation=np.concatenate([(turn @ chain.rotation[0])[None], chain.rotation[1:]]),
    )
    more = -9.81 * (turn.T[:, 2] - [0, 0, 1])  # of gravity, in the axes of the turned base
    segment = recording(model, 2, seed=9)
    scene, other = (
        scene_of(GreyBox(each, model.layout, model.values, STEP, np.ones(1)), segment.q, segment.signals,
                 segment.start_s, segment.channels)
        for each in (chain, turned)
    )  # fmt: skip
    rows = effect_rows_at(library()["mounting"], scene, {}, (0, 1, 2), more) @ more
    np.testing.assert_allclose(rows, other.predicted - scene.predicted, atol=1e-6)


def test_a_ceiling_is_within_the_bounds_also_where_the_masses_of_the_model_are_too_small(model):
    scene = segment_scene(model, recording(model, 2, seed=9))
    (turned,) = [place for place in library()["mounting"].places(scene) if len(place.parameters) == 3]
    assert all(each.high > 1.2 * 2 * 9.81 for each in turned.parameters)


def test_power_does_not_show_the_zero_of_a_vertical_axis(model):
    rows = effect_rows(library()["joint_zero"], segment_scene(model, recording(model, 2, seed=9)))
    assert np.abs(rows[:, 0]).max() < 1e-4 < 1.0 < np.abs(rows[:, 1]).max()


def test_a_joint_that_stands_elsewhere_takes_what_a_model_takes_there(model):
    """A thousandth of a radian at joint 2: the law is linear."""
    segment, shift = recording(model, 2, seed=9), 1e-3 * (np.arange(model.axes) == 1)
    scene, other = (
        scene_of(model, q, segment.signals, segment.start_s, segment.channels) for q in (segment.q, segment.q + shift)
    )
    rows = effect_rows_at(library()["joint_zero"], scene, {}, (1,), np.array([1e-3]))[:, 0] * 1e-3
    expected = other.predicted - scene.predicted
    assert np.abs(rows - expected).max() < 2e-3 * np.abs(expected).max()
