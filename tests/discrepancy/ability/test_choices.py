"""Which further column, or whether more minutes, would help: counted by the certificate itself."""

from dataclasses import replace

import numpy as np
import pytest

from acqd.discrepancy.ability.ability import Ability
from acqd.discrepancy.ability.choices import assumptions, choices_table, most_helpful
from acqd.discrepancy.further_columns import further_choices, unread
from acqd.discrepancy.regression.setup import Comparison, set_up
from acqd.discrepancy.selection.session_columns import with_sessions
from acqd.discrepancy.selection.spread import More
from acqd.discrepancy.stand_ins import with_signals
from acqd.models.effects import library
from tests.builders import recording

CHOSEN = (
    "coulomb_friction", "viscous_friction", "thermal_friction", "payload", "offset_shift", "brake_holding",
    "tool_actuation", "line_voltage",
)  # fmt: skip


def bare(segment):
    """With the brakes' signal, and without that of the tool and without the voltage."""
    return replace(segment, signals={"brake": segment.signals["brake"]}, channels={})


@pytest.fixture(scope="module")
def comparison(model, robot):
    before = [bare(recording(model, k, rows=200, seed=1)) for k in range(3)]
    after = [bare(recording(model, k, rows=200, seed=2, start_s=1e9 + 5000)) for k in range(3)]
    return Comparison(
        model=model, robot=robot, in_question=after, reference=before, chosen=frozenset(CHOSEN), withheld=frozenset()
    )


@pytest.fixture(scope="module")
def rows(comparison):
    return with_sessions(set_up(comparison, lambda _: None))


@pytest.fixture(scope="module")
def gate(rows):
    return rows.design.columns.in_question


@pytest.fixture(scope="module")
def plan(rows, gate):
    return Ability.planned(rows, gate, 1.0)


@pytest.fixture(scope="module")
def choices(comparison, rows, plan):
    return {each.name: each for each in further_choices(comparison, rows, plan, 1.0, lambda *_: None)}


def test_the_plan_has_every_effect_with_a_size_and_changes_nothing(plan, choices):
    as_planned = choices["as planned"]
    assert as_planned.effects == len(plan.easiest) and as_planned.shrinks == 1 and not as_planned.gains_most
    told = [each for _, (place, rivals) in plan.easiest.items() for each in rivals if each.id in plan.easiest]
    confused = sum(
        each.size is None or each.size > plan.easiest[name][0].size * (1 + 1e-9)
        for name, (_, rivals) in plan.easiest.items()
        for each in rivals
        if each.id in plan.easiest
    )
    assert told and as_planned.pairs - as_planned.apart == confused


def test_more_of_everything_never_needs_larger_effects(choices):
    for name in ("twice the minutes", "as many minutes on another day", "twice the unchanged recordings"):
        assert choices[name].shrinks <= 1 and choices[name].effects >= choices["as planned"].effects, name
    assert choices["as many minutes on another day"].shrinks < choices["twice the minutes"].shrinks


def test_another_day_is_worth_what_the_spread_of_sessions_says(rows, gate, plan):
    """The term of the day is halved, those of the logs and of the reference stay."""
    once, twice = (Ability.planned(rows, gate, 1.0, doubled=False, more=More(days=d)) for d in (1.0, 1e9))
    limited = [
        (a.size, b.size)
        for (a, _), (b, _) in zip(once.places, twice.places, strict=True)
        if a.limited_by == b.limited_by == "sessions" and b.size
    ]
    assert limited and all(np.sqrt(0.3) < b / a < 1 for a, b in limited)


def test_a_signal_that_is_missing_shows_its_own_effect(choices):
    assert choices["the tool's signal"].gains_most.startswith("tool_actuation")
    assert choices["the mains voltage"].gains_most.startswith("line_voltage")
    assert choices["the tool's signal"].effects == choices["as planned"].effects + 1
    assert "the brakes' signal" not in choices  # recorded


def test_torques_help_where_rows_limit_and_never_harm(rows, gate, plan, choices):
    for name in ("torques of joint sensors", "currents of motors"):
        assert choices[name].shrinks <= 1 + 1e-9 and "1.0 %" in choices[name].assumed


def test_stand_ins_keep_what_was_recorded(comparison):
    own = replace(comparison.in_question[0], signals={"tool": np.ones(200)})
    (filled,) = with_signals([own], comparison.model.step_s)
    assert (filled.signals["tool"] == 1).all() and set(filled.signals) == {"tool", "brake"}
    assert 0.9 * 230 < filled.channels["Vrms"].mean() < 1.1 * 230 and filled.P is own.P


def test_sentences_and_table_name_the_best(choices):
    said = " ".join(most_helpful(choices.values()))
    assert "tool_actuation" in said
    header, first, second, *_ = choices_table(choices.values())
    assert first[0] == "as planned" and len(first) == len(header)
    assert float(second[3]) == pytest.approx(min(each.shrinks for each in choices.values()), abs=0.01)
    assert any("tool" in each for each in assumptions(choices.values()))
    assert most_helpful([choices["as planned"]]) == ["Neither more minutes nor a further column would tell more."]
    assert all(name not in effect.needs for name in unread() for effect in library().values())
