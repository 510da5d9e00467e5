"""What a verdict may say."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acqd.discrepancy.recordings import Subject
from acqd.discrepancy.repair.guard import Improved
from acqd.discrepancy.repair.terms import added
from acqd.discrepancy.repair.torque_scale import TorqueScale
from acqd.discrepancy.repair.usual_error import UsualError
from acqd.discrepancy.residual.residuals import errors_of
from acqd.discrepancy.selection.accepted import Tracing, Unknown
from acqd.discrepancy.verdict import grown, settled
from tests.builders import grey, recording
from tests.discrepancy.independent import COMMON, INDEPENDENT, selected


def test_an_error_beyond_that_of_the_reference_has_grown():
    model = grey()
    reference = [recording(model, k, rows=60) for k in range(8)]
    new = [recording(model, k, rows=60, seed=3) for k in range(4)]
    random = np.random.default_rng(1)
    usual = [random.normal(0, 6.1, 60) for _ in reference]
    assert grown(new, [random.normal(0, 11.6, 60) for _ in new], reference, usual)
    assert not grown(new, [random.normal(0, 6.1, 60) for _ in new], reference, usual)
    assert not grown(new, [random.normal(0, 11.6, 60) for _ in new], [], [])
    one_stop = [random.normal(0, 6.1, 60) for _ in new]
    one_stop[0] = one_stop[0] * 10
    assert not grown(new, one_stop, reference, usual)


@pytest.mark.parametrize(
    ("now_W", "verdict"), [(5.0, "not_identifiable"), (16.0, "unknown_structure"), (50.0, "unknown_structure")]
)
def test_an_unnamed_cause_is_a_finding_only_where_the_residual_has_grown(now_W, verdict):
    model, random = grey(), np.random.default_rng(2)

    def recordings(count, size_W, seed):
        made = [recording(model, k, rows=60, seed=seed) for k in range(count)]
        return [replace(each, P=each.P + random.normal(0, size_W, 60)) for each in made]

    reference, new = recordings(8, 10.0, 0), recordings(4, now_W, 3)
    subject = Subject(None, model, model, None, None, "change", new, new, reference, frozenset(), frozenset(), [])
    errors = errors_of(model, new)
    improved = Improved(model, kept=[], reported_only=[], refused=[], gains=[], errors=errors)
    tracing = Tracing(design=None, regression=None, unknown=Unknown(None, None))
    said, _, notes = settled(subject, tracing, improved, errors, UsualError.of(subject, 0.5))
    assert said == verdict and ("has not grown" in " ".join(notes)) == (said == "not_identifiable")


def test_an_effect_of_too_little_confidence_is_a_hypothesis(model, robot):
    reference = [recording(model, k, seed=1) for k in range(7)]
    new = [recording(model, k, INDEPENDENT["coulomb_friction"], seed=2, start_s=1e9 + 5000) for k in range(7)]
    _, tracing = selected(model, robot, new, reference, COMMON)
    likely = added(tracing, tracing.effects[0], TorqueScale(1.0, 0.0), 1)
    unlikely = replace(likely, confidence=0.43, family_confidence=0.43)
    subject = Subject(None, model, model, None, None, "change", new, new, reference, frozenset(), frozenset(), [])
    errors = errors_of(model, new)
    said = {}
    for each in (likely, unlikely):
        improved = Improved(model, kept=[], reported_only=[each], refused=[], gains=[], errors=errors)
        said[each.sure] = settled(subject, tracing, improved, errors, UsualError.of(subject, 0.5))
    assert said[True][0] == "effects_found" and said[True][1].reported_only == [likely]
    assert said[False][0] == "not_identifiable" and not said[False][1].reported_only
    tracing.unknown = Unknown(None, None)
    useless = Improved(model, kept=[likely], reported_only=[], refused=[], gains=[0.0], errors=errors)
    verdict, improved, _ = settled(subject, tracing, useless, errors, UsualError.of(subject, 0.5))
    assert verdict == "unknown_structure" and not improved.kept and not improved.reported_only
    assert "(joint 2) has a confidence of 43%, less than 85%: no finding" in " ".join(said[False][2])
    assert tracing.hypotheses[0].missing == ["a confidence of 85% (the effect has 43%)"]


def test_a_load_at_times_that_nobody_predicts_counts_by_what_it_explains_at_its_times(model, robot):
    """Its mean power is what a model can add; on held-out recordings that explains little of a strong load."""
    reference = [recording(model, k, seed=1) for k in range(7)]
    new = [recording(model, k, INDEPENDENT["coulomb_friction"], seed=2, start_s=1e9 + 5000) for k in range(7)]
    _, tracing = selected(model, robot, new, reference, COMMON)
    (named,) = tracing.effects
    subject = Subject(None, model, model, None, None, "change", new, new, reference, frozenset(), frozenset(), [])
    errors = errors_of(model, new)
    verdicts = {}
    for name in ("coulomb_friction", "contact_force"):
        finding = replace(named.finding, candidate=replace(named.finding.candidate, id=name))
        each = added(tracing, named, TorqueScale(1.0, 0.0), 1)
        each = replace(each, term=replace(each.term, id=name))
        tracing.effects = [replace(named, finding=finding)]
        improved = Improved(model, [each], [], [], [0.1], [0.99 * error for error in errors])
        verdicts[name] = settled(subject, tracing, improved, errors, UsualError.of(subject, 0.5))[0]
        tracing.effects = [named]
    assert verdicts == {"coulomb_friction": "not_identifiable", "contact_force": "effects_found"}


def test_a_surge_of_some_rows_is_found_beside_a_wander_that_it_does_not_explain(model, robot):
    reference = [recording(model, k, seed=1) for k in range(7)]
    new = [recording(model, k, INDEPENDENT["coulomb_friction"], seed=2, start_s=1e9 + 5000) for k in range(7)]
    _, tracing = selected(model, robot, new, reference, COMMON)
    each = added(tracing, tracing.effects[0], TorqueScale(1.0, 0.0), 1)
    subject = Subject(None, model, model, None, None, "change", new, new, reference, frozenset(), frozenset(), [])
    random = np.random.default_rng(3)
    wander = [10 + np.cumsum(random.normal(0, 0.4, len(segment.P))) for segment in new]
    verdicts = {}
    for power_W in (0.5, 60.0):
        surge = [np.where(np.arange(len(error)) < 8, power_W, 0.0) for error in wander]
        before = [error + own for error, own in zip(wander, surge, strict=True)]
        improved = Improved(model, [each], [], [], [0.1], wander)
        verdicts[power_W] = settled(subject, tracing, improved, before, UsualError.of(subject, 0.5))[0]
    assert verdicts == {0.5: "not_identifiable", 60.0: "effects_found"}


@given(st.floats(0.7, 1.4), st.floats(0.0, 0.1), st.floats(0.1, 20), st.just(0.0) | st.floats(1e-9, 2))
def test_true_units(scale, deviation, value, half):
    true, wide = TorqueScale(scale, deviation).corrected(value, half, "kg")
    assert true == pytest.approx(value / scale)
    assert wide >= half / scale * (1 - 1e-9)
    assert wide >= 1.96 * deviation / scale * true * (1 - 1e-9)
    assert TorqueScale(scale, deviation).corrected(value, half, "W") == (value, half)


def test_a_torque_sensor_needs_no_correction():
    sensor = TorqueScale(1.0, 0.02)
    assert sensor.corrected(3.0, 0.3, "Nm")[0] == 3.0
    assert replace(sensor, value=0.9).corrected(1.0, 0.0, "W/Nm^2")[0] == pytest.approx(0.81)
