"""The library of effects and the motion that they see."""

import numpy as np

from acqd.models.effects import library
from acqd.models.effects.scene import scene_of
from acqd.models.effects.substeps import SUBSTEPS, substep_motion
from acqd.models.greybox.model import GreyBox
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
