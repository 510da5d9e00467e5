"""Every effect on machines of one to four axes, turning and sliding."""

import numpy as np
import pytest

from acqd.models.effects import library
from acqd.models.effects.effect import effect_rows
from acqd.models.effects.scene import segment_scene
from acqd.models.greybox.model import GreyBox
from acqd.models.greybox.parameters import Layout, prior
from acqd.robot.arm import Arm
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
