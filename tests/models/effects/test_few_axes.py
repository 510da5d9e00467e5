"""Every effect on machines of one to four axes, turning and sliding."""

import numpy as np
import pytest

from acqd.models.effects import library
from acqd.models.effects.effect import effect_rows
from acqd.models.effects.scene import segment_scene
from acqd.models.greybox.model import GreyBox
from acqd.models.greybox.parameters import Layout, prior
from acqd.robot.arm import Arm
from acqd.robot.description import load_description
from acqd.robot.dynamics import inertial_parameters
from acqd.robot.newton_euler import Chain
from tests.models.motions import STEP, angles, segment
from tests.robot.sliding import link, robot, slide, turn

LIGHT = (0.1, 0.02, 0.05)
MACHINES = {
    "pendulum": robot(turn("a", [0, 1, 0], link(2, LIGHT))),
    "rail": robot(slide("x", [1, 0, 0], link(20, LIGHT))),
    "positioner": robot(turn("a", [1, 0, 0], link(20, LIGHT)), turn("b", [0, 0, 1], link(5, LIGHT))),
    "mill": robot(*(slide(name, axis, link(20, LIGHT)) for name, axis in zip("xyz", np.eye(3).tolist(), strict=True))),
    "palletiser": robot(
        turn("a", [0, 0, 1], link(40, LIGHT)), slide("z", [0, 0, 1], link(20, LIGHT)),
        turn("b", [0, 0, 1], link(10, LIGHT)), turn("c", [0, 0, 1], link(2, LIGHT)),
    ),
}  # fmt: skip


@pytest.fixture(params=MACHINES)
def scene(request):
    machine = MACHINES[request.param]
    layout = Layout(machine.axes, (), machine.sliding)
    values = prior(layout, machine, inertial_parameters(Arm(machine)), 30.0, STEP).mean
    q = 0.5 * angles(120, machine.axes, 3)
    signals = {name: (np.arange(120) % 50 < 25).astype(float) for name in ("brake", "tool")}
    temperature = {"temperature": 30 + np.zeros((120, machine.axes)), "Vrms": np.full(120, 230.0)}
    moved = segment(1, "train", q, np.full(120, 50.0), signals=signals)
    moved.channels.update(temperature)
    return segment_scene(GreyBox(Chain.of(machine), layout, values, STEP), moved)


@pytest.mark.parametrize("identity", sorted(library()))
def test_an_effect_has_finite_columns_and_its_places_name_them(scene, identity):
    effect = library()[identity]
    if effect.detected or not effect.possible(scene):
        pytest.skip("its shape comes from the residual, or the recording has not what it needs")
    columns = effect_rows(effect, scene)
    assert np.isfinite(columns).all() and len(columns) == scene.rows
    for variant in effect.variants(scene):
        assert all(0 <= column < columns.shape[1] for column in variant.columns), variant
    assert isinstance(effect.c_constants(scene.model, dict(effect.shapes[0])), dict)


def test_every_size_may_be_above_zero_where_the_fit_has_left_the_machine_no_mass(scene):
    scene.model.values[scene.model.layout.part("inertial")] = 0.0
    for effect in library().values():
        if effect.detected or not effect.possible(scene):
            continue
        for parameter in (each for place in effect.places(scene) for each in place.parameters):
            assert parameter.low < parameter.high and parameter.deviation > 0, (effect.id, parameter)


def test_a_base_turns_about_what_its_joints_feel_and_zeros_have_the_unit_of_their_joint(scene):
    directions = [place.columns for place in library()["mounting"].places(scene)]
    if scene.axes > 1:
        assert directions == [(0, 1), (0, 1, 2)]
    else:  # a pendulum about y, and a slide along x
        assert directions == [(0,), (0,) if scene.model.layout.sliding else (0, 2)]
    units = [place.parameters[0].unit for place in library()["joint_zero"].places(scene)]
    assert units == ["m" if k in scene.model.layout.sliding else "rad" for k in range(scene.axes)]


DETECTED_SHAPE = {"joint": 1.0, "periods_per_turn": 100.0, "share_of_time": 0.5}


def places_of(effect, scene):
    return [effect.detected_place(DETECTED_SHAPE, scene.model)] if effect.detected else effect.places(scene)


def arm_scene():
    machine = load_description("ur10e")
    layout = Layout(machine.axes, ("brake", "tool"), ())
    values = prior(layout, machine, inertial_parameters(Arm(machine)), 30.0, STEP).mean
    signals = {name: (np.arange(120) % 50 < 25).astype(float) for name in ("brake", "tool")}
    moved = segment(1, "train", 0.5 * angles(120, 6, 3), np.full(120, 50.0), signals=signals)
    moved.channels["Vrms"] = np.full(120, 230.0)
    return segment_scene(GreyBox(Chain.of(machine), layout, values, STEP), moved)


@pytest.mark.parametrize("identity", sorted(library()))
def test_every_parameter_at_every_place_has_physical_bounds_on_both_sides(scene, identity):
    effect = library()[identity]
    if not effect.detected and not effect.possible(scene):
        pytest.skip("the recording has not what it needs")
    for place in places_of(effect, scene):
        for each in place.parameters:
            assert np.isfinite([each.low, each.high]).all() and each.low <= 0.0 < each.high, (place.where, each)


IMPOSSIBLE = {
    "brake_holding": {"power": 400.0},
    "brake_release": {"power 20-60 ms": 5e3},
    "clock_drift": {"power later by": 3.0},
    "clock_offset": {"power later by": -2.0},
    "contact_force": {"force up": 2e3},
    "copper_loss": {"loss": 1e4},
    "coulomb_friction": {"torque": 2e3},
    "gear_ripple": {"sine": -400.0},
    "gravity_bias": {"mass": -60.0},
    "joint_zero": {"shift": 0.5},
    "line_voltage": {"exponent": 8.0, "power per relative voltage": 5e5},
    "load_dependent_friction": {"share of the load": 1.5},
    "mechanical_power": {"lost share": 3.44, "share": -2.71, "share lost beside the motor": 3.44},
    "meter_gain": {"gain error": -1.2},
    "meter_saturation": {"share lost above": 2.0},
    "mounting": {"gravity x": 35.0, "gravity z": -35.0},
    "offset_shift": {"power": -60.0},
    "payload": {"mass": 120.0},
    "process_load": {"power": -5.0},
    "regeneration_clipping": {"share": 3.0},
    "stribeck_friction": {"torque": 2e3},
    "supply_efficiency": {"loss at 100 W": 117.0},
    "thermal_friction": {"cold coefficient": 1e5},
    "thermostat": {"power": -5.0},
    "tool_actuation": {"power": 1e4},
    "viscous_friction": {"coefficient": 1e5},
}


@pytest.fixture(scope="module")
def arm():
    return arm_scene()


@pytest.mark.parametrize("identity", sorted(library()))
def test_what_no_arm_of_thirty_kilograms_does_is_out_of_bounds(arm, identity):
    """The table has every effect: a new effect needs a line."""
    parameters = [each for place in places_of(library()[identity], arm) for each in place.parameters]
    for name, value in IMPOSSIBLE[identity].items():
        [*concerned] = (each for each in parameters if each.name == name)
        assert concerned and not any(each.low < value < each.high for each in concerned), (name, concerned)
