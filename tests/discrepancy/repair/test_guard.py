"""The guard: held-out recordings of another motion than the reference."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from acqd.discrepancy.repair import guard, predictive
from acqd.discrepancy.repair.guard import improve
from acqd.discrepancy.repair.predictive import Beside, Predictive
from acqd.discrepancy.repair.terms import reported
from acqd.discrepancy.repair.torque_scale import TorqueScale
from acqd.discrepancy.repair.usual_error import UsualError
from acqd.models.augmented import Augmented
from acqd.models.effects.scene import segment_scene
from acqd.residual.residuals import errors_of, rms
from tests.builders import grey, recording
from tests.discrepancy.independent import COMMON, extra_power, payload_torque, selected
from tests.discrepancy.repair.test_correcting import subject_of
from tests.discrepancy.report.subjects import found


def rubbing(scene, random):
    """W of a friction that the model lacks on both sides."""
    return extra_power(scene, rubbing_torque(scene))


def rubbing_torque(scene):
    return 4.0 * np.tanh(scene.qd / 0.01) * np.minimum(np.abs(scene.qd) / 0.3, 1.0) ** 2


def loaded_and_rubbing(scene, random):
    return extra_power(scene, rubbing_torque(scene) + payload_torque(scene, 2.0))


@pytest.mark.slow
def test_a_base_model_that_is_wrong_in_another_motion_decides_little(robot):
    """Before, the robot moved at less than half of the speed."""
    model = grey()
    reference = [recording(model, k, rubbing, seed=1, slower=2.5) for k in range(6)]
    segments = [recording(model, k, loaded_and_rubbing, seed=2, start_s=1e9 + 5000) for k in range(6)]
    fit, held_out = segments[:4], segments[4:]
    _, selection = selected(model, robot, fit, reference, COMMON)
    assert [each.id for each in selection.effects] == ["payload"], [row.as_text() for row in selection.table]
    subject = subject_of(robot, model, model, fit, held_out, reference)
    payload = reported(selection, selection.effects[0], TorqueScale(1.0, 0.0))
    errors, predictive = errors_of(model, held_out), Predictive.of(selection, subject)
    (judged,) = improve(subject, [payload], errors, predictive, 1, grown=lambda _: True).effects
    assert judged.status == "added"
    smooth = [
        each - rubbing(segment_scene(model, segment), None) for each, segment in zip(errors, held_out, strict=True)
    ]
    plain = replace(predictive, beside=None)
    gain, plain_gain = (each.density(smooth, ()) - each.density(errors, ()) for each in (predictive, plain))
    assert gain < 0.2 * plain_gain
    loaded = errors_of(Augmented.of(model, model, [payload.term]), held_out)
    assert predictive.density(loaded, {("payload", payload.term.where)}) - predictive.density(errors, ()) > 2 * gain


@pytest.mark.parametrize(("added", "grown"), [(rubbing, False), (loaded_and_rubbing, True)])
def test_errors_have_not_grown_where_the_reference_explains_them_in_faster_motion(robot, added, grown):
    model = grey()
    reference = [recording(model, k, rubbing, seed=1, slower=2.5) for k in range(6)]
    segments = [recording(model, k, added, seed=2, start_s=1e9 + 5000) for k in range(6)]
    fit, held_out = segments[:4], segments[4:]
    _, selection = selected(model, robot, fit, reference, {"coulomb_friction", "viscous_friction"})
    subject = subject_of(robot, model, model, fit, held_out, reference)
    usual, errors = UsualError.of(subject, 0.5), errors_of(model, held_out)
    assert usual.exceeded_by(held_out, errors)
    assert usual.exceeded_by(held_out, Predictive.of(selection, subject).of_change(errors)) == grown


def test_held_out_recordings_are_as_warm_as_their_session(robot):
    """The second session began after two hours of work, when gears that were cold in the first had warmed up."""
    model = grey()
    segments = [recording(model, k, seed=2, start_s=1e9 + 5000) for k in range(4)]
    segments += [replace(recording(model, k, seed=3, start_s=2e9), session="warm", worked_s=7200.0) for k in range(4)]
    fit, held_out = segments[:2] + segments[4:6], segments[2:4] + segments[6:]
    reference = [recording(model, k, seed=1) for k in range(4)]
    _, selection = selected(model, robot, fit, reference, {"thermal_friction"})
    subject = subject_of(robot, model, model, fit, held_out, reference)
    base, levels = selection.design.columns.base, 2
    thermal = [each[:, base:-levels] for each in Beside.of(selection, subject).columns]
    assert 0 < rms(thermal[2:]) < 0.1 * rms(thermal[:2])


def test_what_the_reference_leaves_open_is_as_small_as_what_it_shows():
    """Of forty columns half act as hardly as the other half acts much; all have coefficients of one size."""
    random = np.random.default_rng(3)
    rows = random.normal(0, 1, (4000, 40)) * np.where(np.arange(40) < 20, 1.0, 1e-4)
    true = random.normal(0, 0.1, 40)
    normal, product = rows.T @ rows, rows.T @ (rows @ true + random.normal(0, 1, 4000))
    pull = predictive._shared_prior(normal, product, np.arange(40), np.full(40, 10.0), 0.7)
    assert np.allclose(pull, pull[0]) and 0.05 < (0.7 * pull[0]) ** -0.5 < 0.2
    errors = [np.linalg.solve(normal + np.diag(each), product) - true for each in (pull, np.full(40, 1e-9))]
    assert np.abs(errors[0]).max() < 0.5 < 50 < np.abs(errors[1]).max()


def test_what_predicts_better_and_does_not_reduce_the_error_is_reported_and_not_added(monkeypatch):
    """A level of minutes hides an effect from the RMSE, not from the density."""
    effect = replace(found("coulomb_friction", {"torque": (0.9, 0.5)}), status="named")
    subject = SimpleNamespace(model=grey(), question="change")
    density = SimpleNamespace(density=lambda errors, places: float(len(places)), without_load=lambda errors: errors)
    for with_effect_W, grown, status in ((1.1, True, "reported"), (1.1, False, "refused"), (0.9, False, "added")):
        errors = {0: [np.full(50, 1.0)], 1: [np.full(50, with_effect_W)]}
        monkeypatch.setattr(guard._Errors, "of", lambda _, effects, errors=errors: errors[len(effects)])
        (judged,) = improve(subject, [effect], errors[0], density, 1, grown=lambda _, grown=grown: grown).effects
        assert judged.status == status
    nothing = SimpleNamespace(density=lambda errors, places: -float(len(places)), without_load=lambda errors: errors)
    assert improve(subject, [effect], errors[0], nothing, 1, grown=lambda _: True).effects[0].status == "refused"


def test_beside_an_added_effect_the_error_that_is_left_decides_what_is_reported(monkeypatch):
    """A payload explains the growth: a friction that follows what sessions differ by is then no finding."""
    payload, friction = (
        replace(found(name, {"torque": (0.9, 0.5)}, where=name), status="named")
        for name in ("payload", "coulomb_friction")
    )
    sizes = {(): 3.0, ("payload",): 1.0, ("coulomb_friction",): 3.1, ("payload", "coulomb_friction"): 1.1}
    errors = {key: [np.full(50, size)] for key, size in sizes.items()}
    monkeypatch.setattr(guard._Errors, "of", lambda _, effects: errors[tuple(each.term.id for each in effects)])
    subject = SimpleNamespace(model=grey(), question="change")
    density = SimpleNamespace(density=lambda errors, places: float(len(places)), without_load=lambda errors: errors)
    for usual_W, status in ((1.5, "refused"), (0.5, "reported")):
        judged = improve(
            subject, [payload, friction], errors[()], density, 1, grown=lambda e, usual=usual_W: e[0][0] > usual
        ).effects
        assert [each.status for each in judged] == ["added", status]
