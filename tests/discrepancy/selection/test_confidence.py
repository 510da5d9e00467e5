"""How sure a name is: spread over recordings, columns that may be wrong, families, laws."""

from dataclasses import replace

import numpy as np
import pytest

from acqd.discrepancy.regression.design_columns import Candidate, Twin
from acqd.discrepancy.selection import confidence as sure
from acqd.discrepancy.selection.confidence import Confidence, confidence
from acqd.discrepancy.selection.ranking import Finding
from acqd.discrepancy.thresholds import THRESHOLDS
from tests.discrepancy.independent import COMMON, INDEPENDENT, added_payload, column, extra_power, traced


@pytest.fixture(scope="module")
def warm(model, robot):
    """Viscous friction: recordings of a few minutes cannot tell it from a cold gear."""

    def viscous(scene, random):
        return extra_power(scene, column(scene, 1, 8.0 * scene.qd[:, 1]))

    return traced(model, robot, viscous, count=5, only=COMMON | {"viscous_friction", "thermal_friction"})[1]


def test_a_tie_is_said_as_a_family(warm):
    (effect,) = warm.effects
    found = confidence(warm, effect)
    assert "thermal_friction" in [name for name, _ in found.family] or effect.id == "thermal_friction"
    assert found.share < 0.85 < found.family_share <= 1 - THRESHOLDS.chance


@pytest.mark.parametrize(("odds", "family"), [(0.1, False), (0.25, True)])
def test_a_rival_that_denies_the_name_its_confidence_is_of_the_family(warm, monkeypatch, odds, family):
    """However far ahead the name is: no rival that is a little worse may silence what one as good would not."""
    monkeypatch.setattr(sure, "margin", lambda *_: -1e9)
    effect = warm.effects[0]
    other = "thermal_friction" if effect.id == "viscous_friction" else "viscous_friction"
    monkeypatch.setattr(sure, "_odds", lambda _, __, ___, rival, *____: odds if rival.candidate.id == other else 0.0)
    found = confidence(warm, effect)
    assert bool(found.family) == family
    assert found.family_share > THRESHOLDS.least_confidence


def test_an_effect_that_would_draw_the_same_power_shares_the_confidence(warm):
    effect = warm.effects[0]
    alone = confidence(warm, effect)
    candidate = replace(effect.finding.candidate, twin=Twin("thermostat", "cabinet", 0.25))
    found = confidence(warm, replace(effect, finding=replace(effect.finding, candidate=candidate)))
    assert found.share == pytest.approx(0.75 * alone.share) and found.family_share == alone.family_share
    assert found.family[0] == ("thermostat", "cabinet")
    assert dict(found.rivals)["thermostat"] == pytest.approx(0.25 * alone.share)


def test_the_first_step_says_how_every_hypothesis_stands(warm):
    behind = warm.standing.behind(10.0)
    assert min(behind, key=behind.get) in {"viscous_friction", "thermal_friction"} and max(behind.values()) > 0
    assert warm.standing.above_nothing > 0


def test_nothing_is_drawn_at_random(warm):
    assert confidence(warm, warm.effects[0]) == confidence(warm, warm.effects[0])


def odds(own, rival, gained, monkeypatch, law=False, left=0.0, ids=("copper_loss", "copper_loss")):
    monkeypatch.setattr(sure, "left_by", lambda *_: left)
    candidates = [Candidate("" if law else name, "x", np.zeros(1, dtype=int)) for name in ids]
    findings = [
        Finding(candidate, np.ones(1), np.ones(1), evidence)
        for candidate, evidence in zip(candidates, (own, rival), strict=True)
    ]

    class Rows:
        design = None

    class Effect:
        class gate:  # noqa: N801
            open = np.ones(1)

    monkeypatch.setattr(sure, "_superfluous_beside", lambda *_: np.inf)
    return sure._odds(Rows(), Effect(), *findings, np.array(gained, dtype=float), 40)


@pytest.fixture
def beside(warm, monkeypatch):
    """Odds that an effect is superfluous beside a law, where it has `rest` evidence and gains that of recordings."""
    effect = warm.effects[0]
    monkeypatch.setattr(sure, "margin", lambda *_: 20.0)

    def odds_of(rest, gained):
        again = replace(effect.finding, evidence=rest)
        monkeypatch.setattr(sure, "ranked", lambda *_: [again])
        monkeypatch.setattr(sure, "gains", lambda *_: (["a", "b", "c", "d"], np.array([gained], dtype=float)))
        law = replace(effect.finding, candidate=replace(effect.finding.candidate, id=""))
        return sure._superfluous_beside(warm.rows, effect, effect.finding, law, np.full(4, 100.0), 40)

    return odds_of


def test_an_effect_that_is_needed_beside_a_law_is_right_whatever_the_law_explains(beside):
    """A heavier bob, and a friction whose curve has changed: both, not one in the place of the other."""
    assert beside(45.0, [11, 12, 11, 11]) < 0.01
    assert beside(15.0, [4, 4, 4, 4]) > 1.0
    assert 0.1 < beside(45.0, [50, -5, 0, 0]) < 1.0


def test_a_law_is_a_doubt_only_where_it_explains_more_and_leaves_nothing(monkeypatch):
    monkeypatch.setattr(sure, "_explains_more", lambda *_: 0.5)
    monkeypatch.setattr(sure, "_superfluous_beside", lambda *_: 0.01)
    law, effect = Candidate("", "x", np.zeros(1, dtype=int)), Candidate("payload", "x", np.zeros(1, dtype=int))
    of = {c.id: Finding(c, np.ones(1), np.ones(1), 100.0) for c in (law, effect)}
    gained = np.ones((2, 4))
    assert sure._odds(None, None, of["payload"], of[""], gained, 40) == 0.01
    assert sure._odds(None, None, of["payload"], of["payload"], gained, 40) == 0.5


def test_recordings_that_disagree_make_a_name_less_sure(monkeypatch):
    agree = odds(400, 300, [[100] * 4, [75] * 4], monkeypatch)
    disagree = odds(400, 300, [[100] * 4, [150, 0, 150, 0]], monkeypatch)
    assert agree < 0.001 < 0.1 < disagree


def test_recordings_that_say_more_may_differ_by_more(monkeypatch):
    """One long recording with nearly all of the evidence is no disagreement."""
    assert odds(4060, 1015, [[4000, 30, 20, 10], [1000, 7, 5, 3]], monkeypatch) < 0.01


def test_wrong_columns_make_a_small_lead_unsure(monkeypatch):
    gained = [[100] * 4, [90] * 4]
    assert odds(400, 360, gained, monkeypatch) < 0.001
    assert odds(400, 360, gained, monkeypatch, left=4000.0) > 0.1


def test_a_law_has_to_explain_more_by_the_margin(monkeypatch):
    """What chance gives the best of many, and what wrong columns leave to a curve."""
    gained = [[100] * 4, [101] * 4]
    assert odds(400, 404, gained, monkeypatch, law=True, left=100.0) < 0.01
    assert odds(400, 404, gained, monkeypatch, law=False, left=100.0) > 1.0
    assert odds(400, 424, gained, monkeypatch, law=True, left=100.0) > 1.0
    assert odds(4000, 4040, gained, monkeypatch, law=True, left=4000.0) < 0.2
    assert odds(4000, 4140, gained, monkeypatch, law=True, left=4000.0) > 1.0


def test_of_effects_of_one_quantity_with_as_much_evidence_the_one_without_a_free_shape_is_likelier(monkeypatch):
    """Wrong columns leave a free shape 18 of 0.15^2 * 4000, the other one nothing."""

    def against(own, rival, own_id, rival_id):
        return odds(own, rival, [[100] * 4, [100] * 4], monkeypatch, left=4000.0, ids=(own_id, rival_id))

    assert against(400, 400, "viscous_friction", "coulomb_friction") == pytest.approx(1.0)
    assert against(400, 400, "viscous_friction", "thermal_friction") < 0.6
    assert against(400, 400, "thermal_friction", "viscous_friction") > 1.6
    even = against(400, 418.3, "viscous_friction", "thermal_friction")
    assert even == pytest.approx(1.0, abs=0.01)


@pytest.mark.slow
def test_effects_that_act_together_are_no_rivals_of_each_other(model, robot):
    """Both are part of the explanation: the confidence in one is given the other."""

    def both(scene, random):
        return INDEPENDENT["gear_ripple"](scene, random) + added_payload(scene, random)

    _, selection = traced(model, robot, both, only=COMMON | {"gear_ripple", "payload"})
    assert {each.id for each in selection.effects} == {"gear_ripple", "payload"}
    for effect in selection.effects:
        found = confidence(selection, effect)
        assert found.share > 0.9 and found.agreeing == 1.0
        assert not {name for name, _ in found.rivals} & {"gear_ripple", "payload"}


def test_a_law_that_is_likelier_than_the_family_is_a_doubt(warm, monkeypatch):
    effect = warm.effects[0]
    monkeypatch.setattr(
        sure, "_odds", lambda rows, selected, own, rival, gained, kinds: 0.0 if rival.candidate.id else 4.0
    )
    found: Confidence = confidence(warm, effect)
    assert found.doubt is not None and not found.doubt.finding.candidate.id
    assert found.family_share < THRESHOLDS.least_confidence
    assert replace(found, doubt=None) != found


def test_evidence_that_rests_on_the_description_is_not_lost_among_recordings(monkeypatch):
    """Recordings that gain next to nothing in sum say nothing about the spread of the difference."""
    assert odds(267, 128, [[0, -1, -1, 1, -3, 1], [1, 0, 0, 0, -2, 1]], monkeypatch) < 1e-3
