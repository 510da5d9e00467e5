"""A compressor on the robot's meter, before and after."""

import numpy as np
import pytest

from acqd.discrepancy.regression.setup import COMMON_LOAD, Comparison, set_up
from acqd.discrepancy.repair.predictive import Predictive
from acqd.models.effects.substeps import averaged
from acqd.residual.residuals import errors_of, rms
from tests.builders import recording
from tests.discrepancy.independent import COMMON, selected
from tests.discrepancy.repair.test_correcting import subject_of

SIZE_W = 12.0


def compressor(scene, random):
    return SIZE_W * (((averaged(scene.t) + random.uniform(0, 19.0)) % 19.0) < 7.0)


def beside_a_tool(scene, random):
    return compressor(scene, random) + 1.5 * averaged(scene.signals["tool"])


@pytest.fixture(scope="module")
def site(model, robot):
    """Recordings of a tool whose 1.5 W nobody declared, their reference, and the selection."""
    before = [recording(model, k, compressor, rows=500, seed=1) for k in range(5)]
    after = [recording(model, k, beside_a_tool, rows=500, seed=2, start_s=1e9 + 5000) for k in range(7)]
    return before, after, selected(model, robot, after[:5], before, COMMON | {"tool_actuation", "process_load"})[1]


def test_a_load_on_both_sides_hides_no_small_effect_and_is_no_change(site):
    _, _, selection = site
    assert selection.design.columns.load.size_W == pytest.approx(SIZE_W, rel=0.03)
    assert [each.id for each in selection.effects] == ["tool_actuation"]
    assert selection.effects[0].finding.coefficients[0] == pytest.approx(1.5, rel=0.2)
    assert [each.owner for each in selection.regression.columns].count(COMMON_LOAD) == 1


def test_held_out_recordings_are_judged_without_the_load(site, model, robot):
    before, after, selection = site
    subject = subject_of(robot, model, model, after[:5], after[5:], before)
    errors = errors_of(model, after[5:])
    assert rms(Predictive.of(selection, subject).without_load(errors)) < 2.0 < 5.0 < rms(errors)


def test_every_model_is_judged_beside_the_states_that_its_own_errors_show(site, model, robot):
    """A friction of the load's size blurs the states; with the friction explained, the load leaves nothing."""
    before, after, selection = site
    subject = subject_of(robot, model, model, after[:5], after[5:], before)
    predictive, errors = Predictive.of(selection, subject), errors_of(model, after[5:])
    friction = [0.9 * SIZE_W * (np.sin(np.arange(len(each)) / 15.0) > 0.3) for each in errors]
    blurred = [own + more for own, more in zip(errors, friction, strict=True)]
    assert rms(predictive.without_load(errors)) < 0.7 * rms(predictive.without_load(blurred))
    shared = [own + more - left for own, more, left in zip(
        errors, friction, predictive.without_load(blurred), strict=True
    )]  # fmt: skip
    assert rms([own - on for own, on in zip(errors, shared, strict=True)]) > 2 * rms(predictive.without_load(errors))


def test_a_reference_that_nothing_switches_in_has_no_such_load(model, robot):
    before = [recording(model, k, rows=500, seed=1) for k in range(5)]
    after = [recording(model, k, compressor, rows=500, seed=2, start_s=1e9 + 5000) for k in range(4)]
    comparison = Comparison(model, robot, after, before, frozenset(COMMON), frozenset())
    columns = set_up(comparison, lambda _: None).design.columns
    assert columns.load is None
    assert np.ptp(columns.residual[-1]) > 0.8 * SIZE_W
