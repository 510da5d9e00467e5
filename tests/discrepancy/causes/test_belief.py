"""Probabilities of causes, and sets that hold the cause as often as they say."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acqd.discrepancy.causes.belief import (
    CLASSES,
    MISSED,
    NOTHING,
    OUTSIDE,
    Calibration,
    Scale,
    class_of,
    shipped,
)
from acqd.discrepancy.selection.standing import LAW, Standing
from acqd.models.effects import library

SCALE = Scale(2.0, 0.5, (0.5, 1.5), (1.0, 2.0), 0.02)
evidences = st.floats(-50, 5000)


def standing(evidence, above):
    """Hypotheses at other times: wrong columns move nothing between them."""
    return Standing(evidence, dict.fromkeys(evidence, (0.0, 0.0)), above, {})


@given(st.dictionaries(st.sampled_from([*library(), LAW]), evidences, max_size=8), evidences)
def test_probabilities_of_all_labels_sum_to_one(behind, above):
    shares = SCALE.probabilities(standing(behind, above))
    assert sum(shares.values()) == pytest.approx(1.0)
    assert list(shares.values()) == sorted(shares.values(), reverse=True)
    assert NOTHING in shares and (OUTSIDE in shares) == (LAW in behind)


@given(evidences, evidences, evidences, st.floats(0.1, 50))
def test_a_label_farther_behind_is_less_likely(evidence, law, above, less):
    near = SCALE.probabilities(standing({"payload": evidence, LAW: law}, above))
    far = SCALE.probabilities(standing({"payload": evidence - less, LAW: law}, above))
    assert far["payload"] <= near["payload"]


@given(evidences, evidences, evidences)
def test_whether_anything_has_changed_does_not_depend_on_how_the_hypotheses_stand(evidence, law, above):
    shares = SCALE.likelihoods(standing({"payload": evidence, LAW: law}, above))
    assert shares[NOTHING] == pytest.approx(SCALE.likelihoods(standing({"payload": 1.0, LAW: 0.0}, above))[NOTHING])


def test_twins_share_what_their_power_explains_by_the_odds_of_their_times():
    alone, scale = standing({"process_load": 300.0, LAW: 10.0}, 300.0), replace(SCALE, misled=0.0)
    shares = scale.probabilities(replace(alone, twins={"process_load": ("thermostat", 0.2)}))
    assert shares["thermostat"] == pytest.approx(shares["process_load"] / 4)
    assert shares["thermostat"] + shares["process_load"] == pytest.approx(scale.probabilities(alone)["process_load"])


def drawn(random, count):
    """Cases in which the true label is behind by an exponential, and others by more."""
    names = list(library())[:6]
    for _ in range(count):
        true = str(random.choice([*names, OUTSIDE, NOTHING]))
        evidence = {name: float(random.gamma(3.0, 2.0)) for name in [*names, LAW]}
        above = float(random.gamma(2.0, 1.0))
        if true == NOTHING:
            above = float(random.normal(0, 0.7))
        else:
            evidence[LAW if true == OUTSIDE else true] += float(random.exponential(20.0))
        yield standing(evidence, above), frozenset({true})


def test_sets_hold_the_cause_in_the_share_that_they_say_for_every_class():
    """Whatever the scale is: the theorem asks for exchangeable cases only."""
    random = np.random.default_rng(4)
    for scale in (SCALE, Scale(9.0, 0.1, (-2.0, 0.2), (0.0, 0.5), 0.3)):
        missed: dict[str, list[bool]] = {name: [] for name in CLASSES}
        for _ in range(12):
            calibration = Calibration.of(scale, drawn(random, 150), "")
            for each, (true,) in drawn(random, 60):
                missed[class_of(true)].append(true not in calibration.believed(each).members)
        for name, each in missed.items():
            assert np.mean(each) < MISSED + 3 * np.sqrt(MISSED / len(each)), name


def test_few_cases_of_a_class_leave_no_label_of_it_out():
    """19 are needed before the worst one in twenty may be missed."""
    cases = [(standing({"payload": 20.0 - k, LAW: 9.0}, 9.0), frozenset({"payload"})) for k in range(18)]
    assert Calibration.of(SCALE, cases, "").least["effect"] == 0.0
    more = [*cases, (standing({"payload": 2.0, LAW: 9.0}, 9.0), frozenset({"payload"}))]
    assert Calibration.of(SCALE, more, "").least["effect"] > 0.0


def test_a_set_is_never_empty():
    calibration = Calibration(SCALE, dict.fromkeys(CLASSES, 1.0), {}, "")
    assert calibration.believed(standing({"payload": 0.0, LAW: 0.1}, 50.0)).members == (OUTSIDE,)


def test_the_shipped_calibration_says_what_it_rests_on():
    calibration = shipped()
    assert Calibration.from_json(calibration.as_json()) == calibration
    assert all(calibration.cases[name] >= 1 / MISSED - 1 for name in CLASSES)
    assert "simulated" in calibration.source and sum(calibration.cases.values()) > 100
    clear = calibration.believed(standing({"payload": 900.0, "gravity_bias": 200.0, LAW: 100.0}, 50.0))
    assert clear.members[0] == "payload" and clear.probabilities["payload"] > 0.85 and len(clear.members) == 1
    silent = calibration.believed(standing(dict.fromkeys(library(), 0.5) | {LAW: 0.5}, -0.2))
    assert silent.members[0] == NOTHING
