"""The law without a name that corrects a model."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from acqd.discrepancy.recordings import Subject
from acqd.discrepancy.repair.correcting import corrected, tried
from acqd.discrepancy.repair.guard import Improved, improve
from acqd.discrepancy.repair.law_fit import fit_law
from acqd.discrepancy.repair.predictive import Predictive
from acqd.discrepancy.repair.terms import reported, scaled
from acqd.discrepancy.repair.torque_scale import TorqueScale
from acqd.discrepancy.repair.usual_error import UsualError
from acqd.discrepancy.selection.accepted import Unknown
from acqd.discrepancy.selection.ranking import Finding
from acqd.fmu.variables import parameters_of
from acqd.models.augmented import Augmented, Term
from acqd.models.greybox.fit import fit_grey_box
from acqd.models.predictor import Predictor
from acqd.residual.residuals import errors_of, rms
from tests.builders import STEP, grey, recording
from tests.discrepancy.independent import COMMON, column, extra_power, selected

STIFFNESS = 9.0


class Learned(Predictor):
    """A model that is no grey box: what another model predicts."""

    def __init__(self, model):
        self.axes, self.step_s, self.radius, self.signals = model.axes, model.step_s, model.radius, model.signals
        self.model = model

    def run(self, q, signals):
        return self.model.run(q, signals)

    def start(self):
        return self.model.start()

    def step(self, state, window, signals):
        return self.model.step(state, window, signals)


def spring(scene, random):
    return extra_power(scene, column(scene, 2, STIFFNESS * (scene.q[:, 2] - 0.1)))


def pulling(scene, random):
    """A spring that pulls the other way."""
    return -spring(scene, random)


def recordings(model, add, numbers, start_s):
    return [recording(model, k, add, seed=2, start_s=start_s) for k in numbers]


@pytest.fixture(scope="module")
def sprung(robot):
    """A subject whose recordings have a spring that no effect of the library is, and the selection on them."""
    model = grey()
    reference = [recording(model, k, seed=1) for k in range(6)]
    fit, held_out = (recordings(model, spring, numbers, 1e9 + 5000) for numbers in (range(6), range(6, 9)))
    _, selection = selected(model, robot, fit, reference, COMMON)
    return subject_of(robot, model, model, fit, held_out, reference), selection


def subject_of(robot, model, carrier, fit, held_out, reference):
    data, question = SimpleNamespace(step_s=STEP), "change" if reference else "structure"
    return Subject(
        SimpleNamespace(metadata={}),
        model,
        carrier,
        robot,
        data,
        question,
        fit,
        held_out,
        reference,
        frozenset(),
        frozenset(COMMON),
        [],
    )


def correct(subject, selection):
    errors = errors_of(subject.model, subject.held_out)
    improved = Improved(subject.model, (), errors)
    predictive = Predictive.of(selection, subject)
    trial = tried(subject, selection, improved, predictive, 1)
    grown = UsualError.of(subject, 0.5).exceeded_by(subject.held_out, predictive.of_change(errors))
    return corrected(subject, selection, improved, trial, grown=grown)


@pytest.mark.slow
def test_an_unknown_spring_is_measured_and_corrected(sprung):
    subject, selection = sprung
    assert selection.verdict == "unknown_structure"
    improved, notes = correct(subject, selection)
    assert not notes
    found = improved.correction
    assert found.follows == "a torque that depends on the angle of joint 3"
    assert found.looks_like.startswith("a spring of ") and found.looks_like.endswith(" Nm/rad")
    assert float(found.looks_like.split()[3]) == pytest.approx(STIFFNESS, rel=0.1)
    torque = STIFFNESS * np.abs(np.concatenate([segment.q[:, 2] for segment in subject.fit]) - 0.1)
    low, high = found.size["ci95"]
    assert low <= np.quantile(torque, 0.95) <= high and found.unit == "Nm"
    before, after, usual = (
        rms(errors) for errors in (
            errors_of(subject.model, subject.held_out), improved.errors, errors_of(subject.model, subject.reference)
        )
    )  # fmt: skip
    assert before > 3 * usual and after < 1.1 * usual and found.gain == pytest.approx(before - after)


@pytest.mark.slow
def test_a_correction_is_the_same_from_a_bundle_and_row_by_row(sprung):
    subject, selection = sprung
    improved, _ = correct(subject, selection)
    term = Term.from_json(improved.correction.term.as_json())
    model = Augmented.of(subject.model, subject.carrier, [term])
    assert errors_of(model, subject.held_out)[0] == pytest.approx(improved.errors[0], abs=1e-9)
    segment = subject.held_out[0]
    whole = model.sequence(segment.q, np.column_stack([segment.signals["brake"]]))
    r = model.radius
    padded = np.concatenate([np.repeat(segment.q[:1], r, axis=0), segment.q, np.repeat(segment.q[-1:], r, axis=0)])
    state = model.start()
    rows = [model.step(state, padded[k : k + 2 * r + 1], segment.signals["brake"][k : k + 1]) for k in range(300)]
    assert np.array(rows) == pytest.approx(whole[:300], abs=0.05)


@pytest.mark.slow
def test_a_correction_that_does_not_help_is_not_added(sprung):
    subject, selection = sprung
    model = subject.model
    law = "a torque that depends on the angle of joint 3"
    for add, reason in (
        (None, f"{law} is in an error that has not grown: the model is not corrected"),
        (pulling, f"a correction by {law} does not help on held-out recordings: not added"),
    ):
        improved, notes = correct(replace(subject, held_out=recordings(model, add, range(6, 9), 1e9 + 5000)), selection)
        assert improved.correction is None and not improved.extended
        assert notes == [reason]


@pytest.mark.slow
def test_what_the_motion_does_not_determine_is_described_only(sprung):
    subject, selection = sprung
    slow = next(c for c in selection.design.columns.candidates if c.label == "the time of day")
    unknown = Unknown(Finding(slow, np.zeros(4), np.zeros(4), 80.0), selection.unknown.gate, 15.0)
    improved, notes = correct(subject, replace(selection, unknown=unknown))
    assert improved.correction is None
    assert notes == [
        "something that follows the time of day cannot be predicted from the motion: the model is not corrected"
    ]


@pytest.mark.slow
def test_a_law_is_corrected_beside_a_named_effect(robot):
    """The friction is named first; the rest has no name."""
    model = grey()

    def friction_and_spring(scene, random):
        friction = 8.0 * np.tanh(scene.qd[:, 1] / 0.004)
        return extra_power(scene, column(scene, 1, friction) + column(scene, 2, 9.0 * (scene.q[:, 2] - 0.1)))

    reference = [recording(model, k, seed=1) for k in range(6)]
    fit, held_out = (recordings(model, friction_and_spring, numbers, 1e9 + 5000) for numbers in (range(6), range(6, 9)))
    _, selection = selected(model, robot, fit, reference, COMMON)
    assert [named.id for named in selection.effects] == ["coulomb_friction"]
    subject = subject_of(robot, model, model, fit, held_out, reference)
    friction = reported(selection, selection.effects[0], TorqueScale(1.0, 0.0))
    predictive = Predictive.of(selection, subject)
    improved = improve(subject, [friction], errors_of(model, held_out), predictive, 1, grown=lambda _: True)
    trial = tried(subject, selection, improved, predictive, 1)
    better, notes = corrected(subject, selection, improved, trial, grown=True)
    assert not notes and better.correction.follows == "a torque that depends on the angle of joint 3"
    assert [term.id for term in better.terms] == ["coulomb_friction", "torque_of_angle"]
    assert rms(better.errors) < 1.5 * rms(errors_of(model, reference)) < 0.5 * rms(improved.errors)
    friction_term, spring_term = better.terms
    joint = Augmented.of(model, model, [friction_term, spring_term])
    assert errors_of(joint, held_out)[0] == pytest.approx(better.errors[0])
    assert (
        better.kept[0].gain_W > improved.kept[0].gain_W
    )  # without the spring's error, the friction explains more of the RMS


@pytest.mark.slow
def test_a_grey_box_that_has_absorbed_a_law_is_fitted_again(robot):
    """Without a reference, the model was fitted to recordings with the spring; its masses hold a part of the law."""
    model = grey()
    fit, held_out = (recordings(model, spring, numbers, 1e9) for numbers in (range(7), range(7, 10)))
    absorbed = fit_grey_box(robot, fit, STEP, 1, lambda _: None).model
    _, selection = selected(absorbed, robot, fit, [], COMMON)
    assert selection.unknown is not None
    improved, notes = correct(subject_of(robot, absorbed, absorbed, fit, held_out, []), selection)
    assert not notes and improved.base is not absorbed
    assert rms(improved.errors) < 0.6 * rms(errors_of(absorbed, held_out))


@pytest.mark.slow
def test_a_network_that_has_learned_half_of_a_law_gets_the_other_half(robot):
    """Without a reference; the network is a grey box that knows half of the spring."""
    model = grey()
    fit, held_out = (recordings(model, spring, numbers, 1e9) for numbers in (range(7), range(7, 10)))
    _, selection = selected(model, robot, fit, [], COMMON)
    law = fit_law(selection, selection.unknown, set()).term(TorqueScale(1.0, 0.0))
    learned = Learned(Augmented.of(model, model, [scaled(law, 0.5)]))
    improved, notes = correct(subject_of(robot, learned, model, fit, held_out, []), selection)
    assert not notes and improved.base is learned
    assert improved.correction.term.coefficients == pytest.approx(0.5 * law.coefficients, rel=0.2)
    assert rms(improved.errors) < 0.5 * rms(errors_of(learned, held_out))


@pytest.mark.slow
def test_a_friction_that_begins_at_a_high_speed_has_a_size(robot):
    """It acts in few rows: the torque that 95 % of all rows stay below is zero."""
    model = grey()
    fastest = max(np.abs(np.gradient(recording(model, k, seed=2).q[:, 1], STEP)).max() for k in range(9))

    def late(scene, random):
        above = np.maximum(np.abs(scene.qd[:, 1]) - 0.7 * fastest, 0.0)
        return extra_power(scene, column(scene, 1, 400.0 * above * np.sign(scene.qd[:, 1])))

    reference = [recording(model, k, seed=1) for k in range(6)]
    _, selection = selected(model, robot, recordings(model, late, range(6), 1e9 + 5000), reference, COMMON)
    assert selection.unknown is not None, [named.id for named in selection.effects]
    fitted = fit_law(selection, selection.unknown, set())
    assert fitted.part.law.id == "friction_of_speed"
    term = fitted.term(TorqueScale(1.0, 0.0))
    torque = np.abs(fitted.strength(TorqueScale(1.0, 0.0)))
    assert np.quantile(torque, 0.95) < 0.01 * torque.max() < 0.1 * term.parameters["size"]["value"]
    assert parameters_of(term).mix[:, 0] * term.parameters["size"]["value"] == pytest.approx(term.coefficients)
