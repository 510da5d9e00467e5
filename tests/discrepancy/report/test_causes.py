"""The set of causes as a report says it."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import pytest

from acqd.discrepancy.causes.belief import NOTHING, OUTSIDE, Belief
from acqd.discrepancy.report import causes
from acqd.discrepancy.selection.standing import LAW, Standing
from acqd.models.effects import library
from tests.discrepancy.report.subjects import found

EVIDENCE = {"payload": 600.0, "gravity_bias": 590.0, LAW: 20.0}
STANDING = Standing(EVIDENCE, dict.fromkeys(EVIDENCE, (0.0, 0.0)), 500.0, {})


def closed(
    standing=STANDING,
    reference=("recording",),
    chosen=None,
    effects=(),
    verdict="unknown_structure",
    unexplained=False,
    mistimed=False,
    still_grown=False,
):
    subject = SimpleNamespace(reference=list(reference), chosen=frozenset(chosen or library()))
    return SimpleNamespace(
        selection=SimpleNamespace(standing=standing), subject=subject, improved=SimpleNamespace(effects=effects),
        verdict=verdict, largely_unexplained=unexplained, mistimed=mistimed,
        still_grown=still_grown,
    )  # fmt: skip


def test_a_report_holds_the_set_its_words_and_what_it_rests_on():
    told = causes.as_json(closed())
    assert told["set"][:2] == ["payload", "gravity_bias"] and told["holds"] == pytest.approx(0.95)
    assert told["probabilities"]["payload"] > told["probabilities"]["gravity_bias"] > 0.05
    assert "payload" in told["text"] and "simulated" in told["calibrated_on"]
    assert Standing.from_json(told["scores"]) == STANDING


@pytest.mark.parametrize("other", [{"standing": None}, {"reference": ()}, {"chosen": ["payload"]}])
def test_there_is_no_set_where_the_calibration_says_nothing(other):
    assert causes.believed(closed(**other)) is None and causes.as_json(closed(**other)) is None


def test_a_selected_effect_is_as_probable_as_the_report_says_above():
    """Beside a friction that was selected later, a payload has no rival; before, gravity stood beside it."""
    payload = found("payload", {"mass": (1.0, 0.4)})
    sure = replace(payload, confidence=0.9, alternatives=(("coulomb_friction", 0.08), ("a torque of joint 1", 0.01)))
    told = causes.as_json(closed(effects=(sure,)))
    assert told["set"] == ["payload", "coulomb_friction"] and told["follows"] == "confidence"
    assert told["probabilities"]["payload"] == pytest.approx(0.9)
    assert told["probabilities"]["coulomb_friction"] == pytest.approx(0.08)
    assert sum(causes.believed(closed(effects=(sure,))).probabilities.values()) == pytest.approx(1.0)
    refused = replace(sure, status="refused")
    assert causes.as_json(closed(effects=(refused,)))["follows"] == "standing"


def test_a_name_that_explains_little_is_not_called_the_largest_cause():
    sure = replace(found("payload", {"mass": (1.0, 0.4)}), confidence=0.98)
    assert causes.as_json(closed(effects=(sure,)))["text"] == "the largest cause: payload (98 %)"
    told = causes.as_json(closed(effects=(sure,), unexplained=True))
    assert told["set"] == ["payload", OUTSIDE] and told["probabilities"]["payload"] == pytest.approx(0.98)
    assert told["text"].startswith("the largest cause may be something outside the library: payload (98 %) explains")


@pytest.mark.parametrize("verdict", ["nothing_left", "not_identifiable"])
def test_a_set_does_not_exclude_nothing_where_the_verdict_does_not(verdict):
    proven, open_ = causes.believed(closed()), causes.believed(closed(verdict=verdict))
    assert NOTHING not in proven.members and set(open_.members) == {*proven.members, NOTHING}
    assert open_.probabilities == proven.probabilities
    assert list(open_.members) == [label for label in open_.probabilities if label in open_.members]


def test_power_of_another_time_has_no_set():
    assert causes.believed(closed()) is not None and causes.believed(closed(mistimed=True)) is None


def test_nothing_is_not_believed_where_held_out_recordings_deny_it():
    silent = Standing(dict.fromkeys(EVIDENCE, 0.5), dict.fromkeys(EVIDENCE, (0.0, 0.0)), -0.2, {})
    unclear = {"verdict": "not_identifiable", "still_grown": True}
    assert next(iter(causes.believed(closed(silent, verdict="not_identifiable")).probabilities)) == NOTHING
    assert causes.believed(closed(silent, **unclear)) is None
    assert causes.believed(closed(**unclear)).members[0] == "payload"


def test_words():
    alone = Belief({"payload": 0.97, NOTHING: 0.03}, ("payload",))
    assert causes.sentence(alone, by_confidence=True) == "the largest cause: payload (97 %)"
    assert causes.sentence(alone) == "the largest cause, right in 95 % of simulated cases: payload (97 %)"
    many = Belief({OUTSIDE: 0.4, NOTHING: 0.3} | dict.fromkeys(list(library())[:5], 0.06), ("x",))
    many = Belief(many.probabilities, tuple(many.probabilities))
    assert causes.sentence(many).endswith("and 3 more") and "something outside the library (40 %)" in causes.sentence(
        many
    )
