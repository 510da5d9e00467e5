"""Which effects keep their names, and what the verdict is."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acqd.discrepancy.repair import naming
from acqd.discrepancy.repair.correcting import Trial
from acqd.discrepancy.repair.guard import Improved, helpful
from acqd.discrepancy.repair.naming import named_or_not
from acqd.discrepancy.repair.predictive import Predictive
from acqd.discrepancy.repair.torque_scale import TorqueScale
from acqd.discrepancy.repair.usual_error import UsualError
from acqd.discrepancy.selection.accepted import Unknown
from acqd.discrepancy.verdict import settled
from acqd.residual.whitening import Whitener
from tests.builders import grey, recording
from tests.discrepancy.report.subjects import found

CERTAIN = found("coulomb_friction", {"torque": (0.9, 0.5)})
CLIPPED = found(
    "regeneration_clipping", {"share": (0.7, 3.5), "above_W": (50.0, 10.0)}, {"above_W": 50.0}, "DC link", "-"
)
"""A share from minus 3 to 4 beyond a power that is certain."""

AS_IT_IS = Predictive(None, 0.0, 1.0)
"""Where the reference says nothing of the model's error."""


def selection_of(*effects):
    columns = SimpleNamespace(scenes=SimpleNamespace(drop_kept=lambda: None))
    return SimpleNamespace(effects=effects, rows=None, design=SimpleNamespace(columns=columns))


@pytest.mark.parametrize(
    ("effect", "missing"),
    [
        (CERTAIN, ""),
        (found("payload", {"mass": (1.0, 0.4), "first moment x": (0.0, 0.02)}, where="flange", unit="kg"), ""),
        (
            found("mechanical_power", {"share": (0.067, 0.07)}, where="joint 6", unit="-"),
            "a size whose 95 % interval excludes zero",
        ),
        (CLIPPED, "a size whose 95 % interval excludes zero"),
        (replace(CERTAIN, family_confidence=0.43), "a confidence of 85 % (the effect has 43 %)"),
        (replace(CERTAIN, confidence=0.53), ""),  # the family is sure
        (
            replace(CERTAIN, confidence=0.32, alternatives=(("mechanical_power", 0.64),)),
            "more evidence than mechanical_power",
        ),
        (
            replace(CERTAIN, doubt=Unknown(SimpleNamespace(candidate=SimpleNamespace(label="the speed")), None, 15.0)),
            "more evidence than something that follows the speed",
        ),
    ],
)
def test_an_effect_has_a_name_or_a_reason(effect, missing):
    judged = named_or_not(effect)
    refused = "refused" if missing.startswith("a size") else "hypothesis"
    assert (judged.status, judged.missing) == ((refused, missing) if missing else ("named", ""))
    rows = Improved(None, (judged,), []).hypotheses
    assert [row.missing for row in rows] == ([(missing,)] if missing else [])


@pytest.mark.parametrize(("beyond", "status"), [(True, "refused"), (False, "named")])
def test_a_name_needs_evidence_at_speeds_that_the_reference_has(beyond, status, monkeypatch):
    for name, value in (("torque_scale", None), ("without", None), ("reported", CERTAIN)):
        monkeypatch.setattr(naming, name, lambda *_, value=value: value)
    monkeypatch.setattr(naming, "only_beyond_reference", lambda *_: beyond)
    gate, row = SimpleNamespace(open=None), SimpleNamespace(margin=15.0)
    effect = SimpleNamespace(id="coulomb_friction", key="friction", gate=gate, finding=None, hypothesis=row)
    selection = selection_of(effect)
    (judged,) = naming.named_effects(None, selection, None, lambda *_: None)
    assert judged.status == status and ("speeds that the reference has" in judged.missing) is beyond


def test_a_name_does_not_hang_on_the_name_of_what_acts_beside_it(monkeypatch):
    """A contact beside a friction that may be a cold gear: the friction explains its part, named or not."""
    seen = []

    def reported(selection, effect, _):
        seen.append(selection)
        return replace(CERTAIN, family_confidence=0.5) if effect.key == "friction" else CERTAIN

    monkeypatch.setattr(naming, "torque_scale", lambda _: None)
    monkeypatch.setattr(naming, "reported", reported)
    monkeypatch.setattr(naming, "_only_beyond_reference", lambda *_: False)
    effects = tuple(SimpleNamespace(id=key, key=key) for key in ("friction", "contact"))
    selection = selection_of(*effects)
    judged = naming.named_effects(None, selection, None, lambda *_: None)
    assert [each.status for each in judged] == ["hypothesis", "named"]
    assert all(each is selection for each in seen)


def recordings(model, count, size_W, seed):
    random = np.random.default_rng(seed)
    made = [recording(model, k, rows=60, seed=seed) for k in range(count)]
    return made, [random.normal(0, size_W, 60) for _ in made]


def usual_of(errors):
    return UsualError(tuple(float(np.sqrt(np.mean(each**2))) for each in errors), 6.0)


def test_an_error_beyond_the_spread_of_the_reference_has_grown():
    model = grey()
    _, before = recordings(model, 8, 6.1, 0)
    new, same = recordings(model, 4, 6.1, 3)
    assert usual_of(before).exceeded_by(new, recordings(model, 4, 11.6, 3)[1])
    assert not usual_of(before).exceeded_by(new, same)
    one_stop = [same[0] * 3, *same[1:]]
    assert not usual_of(before).exceeded_by(new, one_stop)
    various = [each * factor for each, factor in zip(before, (0.3, 3) * 4, strict=True)]
    assert not usual_of(various).exceeded_by(new, recordings(model, 4, 11.6, 3)[1])  # so do unchanged recordings
    assert UsualError((), 0.4).exceeded_by(new, same)  # nothing can be said
    assert UsualError((), 0.4).reference_rms is None


@pytest.mark.parametrize(
    ("named", "refused", "unknown", "gains", "now_W", "fit_s", "beyond", "verdict"),
    [
        (True, False, False, None, 16.0, 600, False, "effects_found"),
        (True, False, True, None, 16.0, 600, False, "effects_found"),
        (False, True, False, None, 6.0, 600, False, "not_identifiable"),
        (False, True, True, None, 16.0, 600, False, "unknown_structure"),
        (False, False, True, None, 16.0, 600, False, "unknown_structure"),
        (False, False, True, None, 6.0, 600, False, "not_identifiable"),
        (False, False, True, (6.0, 0.1), 6.0, 600, False, "not_identifiable"),
        (False, False, True, (12.0, 0.1), 6.0, 600, False, "unknown_structure"),
        (False, False, True, (12.0, -0.1), 6.0, 600, False, "not_identifiable"),
        (False, False, True, (12.0, -0.1), 16.0, 600, False, "unknown_structure"),
        (False, False, False, None, 16.0, 600, False, "not_identifiable"),
        (False, False, False, None, 6.0, 600, False, "nothing_left"),
        (False, False, False, None, 6.0, 60, False, "not_identifiable"),
        (False, False, True, (12.0, 0.1), 16.0, 600, True, "not_identifiable"),
    ],
)
def test_the_verdict_follows_from_names_laws_and_the_growth_of_the_error(
    named, refused, unknown, gains, now_W, fit_s, beyond, verdict, monkeypatch
):
    """`gains` of the law on held-out recordings: log density, 7.8 by chance; W. `beyond`: in faster motion only."""
    monkeypatch.setattr("acqd.discrepancy.verdict.only_beyond_reference", lambda rows, *_: beyond or rows != "bare")
    model = grey()
    usual = usual_of(recordings(model, 8, 6.0, 0)[1])
    new, errors = recordings(model, 6, now_W, 3)
    effects = [replace(CERTAIN, status="added")] if named else []
    effects += [CERTAIN.without_name("refused", "a better prediction")] if refused else []
    subject = SimpleNamespace(held_out=new, fit_s=fit_s)
    law = Unknown(None, SimpleNamespace(open=None), 15.0) if unknown else None
    selection = SimpleNamespace(rows="with the refused", unexplained="bare", unknown=law, usual=())
    trial = None if gains is None else Trial(model, None, errors, None, None, gains[1], gains[0])
    improved = Improved(model, tuple(effects), errors)
    assert settled(subject, selection, improved, errors, AS_IT_IS, usual, trial)[0] == verdict


@pytest.mark.parametrize(("now_W", "verdict"), [(6.0, "nothing_left"), (16.0, "not_identifiable")])
def test_what_sessions_differ_by_hides_a_cause_only_where_the_error_has_grown(now_W, verdict):
    model = grey()
    usual = usual_of(recordings(model, 8, 6.0, 0)[1])
    new, errors = recordings(model, 6, now_W, 3)
    subject, selection = (
        SimpleNamespace(held_out=new, fit_s=600),
        SimpleNamespace(unknown=None, usual=(SimpleNamespace(id="", name="a law"),)),
    )
    said, notes = settled(subject, selection, Improved(model, (), errors), errors, AS_IT_IS, usual, None)
    assert said == verdict and [each for each in notes if each.endswith("by a law, too")] == notes
    assert not any("beyond what the reference explains" in each for each in notes)
    lacks = SimpleNamespace(lacks=[0.1 * each for each in errors])  # a tenth, by the reference
    known = replace(AS_IT_IS, beside=lacks)
    said, notes = settled(subject, selection, Improved(model, (), errors), errors, known, usual, None)
    assert said == verdict and all("beyond what the reference explains, " in each for each in notes)


def test_two_effects_that_help_only_together_stay():
    worth = {"": 0.0, "a": -1.0, "b": -1.0, "ab": 5.0, "abc": 4.0, "ac": -2.0, "bc": -2.0, "c": -3.0}
    effects = [replace(CERTAIN, term=replace(CERTAIN.term, id=name)) for name in "abc"]
    kept = helpful(effects, lambda chosen: worth["".join(each.term.id for each in chosen)])
    assert [each.term.id for each in kept] == ["a", "b"]
    assert helpful(effects[2:], lambda chosen: worth["".join(each.term.id for each in chosen)]) == []


def test_a_load_that_the_reference_has_too_decides_nothing_on_held_out_recordings():
    """A compressor shifts one held-out minute up, another down: the better model predicts them better nevertheless."""
    random = np.random.default_rng(4)
    left = [random.normal(0, 1, 1500) for _ in range(2)]
    effect = [np.sin(np.arange(1500) / 40.0) for _ in range(2)]
    shifted = [each + level for each, level in zip(left, (9.0, -7.0), strict=True)]
    before = [each + power - 0.5 for each, power in zip(shifted, effect, strict=True)]
    whitener = Whitener.of([random.normal(0, 1, 4000)])
    assert Predictive(whitener, 8.0, 0.5).density(shifted, ()) > Predictive(whitener, 8.0, 0.5).density(before, ())
    stiff, soft = Predictive(whitener, 1e-3, 0.5), Predictive(whitener, 8.0, 0.5)
    assert soft.density(left, ()) - soft.density(shifted, ()) < 0.1 * (
        stiff.density(left, ()) - stiff.density(shifted, ())
    )


@given(st.floats(0.7, 1.4), st.just(0.0) | st.floats(1e-9, 0.1), st.floats(0.1, 20), st.just(0.0) | st.floats(1e-9, 2))
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
