"""Rules of the search on made-up evidence: onsets, laws in the place of names, effects that become superfluous."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from acqd.discrepancy.regression.design_columns import Candidate
from acqd.discrepancy.regression.onset import Gate
from acqd.discrepancy.selection import forward_selection as search
from acqd.discrepancy.selection import step as step_module
from acqd.discrepancy.selection.accepted import Hypothesis, Selected, Unknown
from acqd.discrepancy.selection.forward_selection import Doubt, Limits, _settled
from acqd.discrepancy.selection.ranking import Finding, Rows
from acqd.discrepancy.selection.step import State, Step, _likeliest, led_by
from acqd.models.effects.places import Place

MARGIN = 30.0
ALWAYS, LATER = Gate("all of it", np.ones(4)), Gate("from r_2 on", np.array([0.0, 0.0, 1.0, 1.0]), "r_2")


def finding(name, evidence):
    label = "" if name else "a torque that depends on the angle of joint 1"
    return Finding(
        Candidate(name, label or "flange", np.zeros(1, dtype=int), key=name or label), np.ones(1), np.ones(1), evidence
    )


def hypothesis(of):
    return Hypothesis(of, MARGIN, np.inf, 5.0, 0.1, "candidate")


def effect(name, evidence):
    own = finding(name, evidence)
    return Selected(own, ALWAYS, Place("flange", (0,), ()), {}, hypothesis(own), None, ())


class Regression:
    def on(self, blocks):
        return self

    def without(self, owner):
        return self

    def with_columns(self, blocks, columns):
        return self


@pytest.fixture
def state(monkeypatch):
    """Of two effects, with margins of 30."""
    for module in (search, step_module):
        monkeypatch.setattr(module, "margin", lambda *_: MARGIN)
    design = SimpleNamespace(witness=None, columns=SimpleNamespace(candidates=[]), blocks=None)
    rows = Rows(design, Regression(), 1.0)
    return State(rows, rows, (ALWAYS, LATER), 40, (effect("payload", 400.0), effect("copper_loss", 90.0)))


@pytest.mark.parametrize(("later", "start"), [(199.0 + MARGIN, None), (201.0 + MARGIN, "r_2")])
def test_an_onset_has_to_explain_more_by_the_margin(later, start, state, monkeypatch):
    evidence = {None: 200.0, "r_2": later}
    monkeypatch.setattr(step_module, "ranked", lambda rows, gate, pool: [finding("payload", evidence[started(gate)])])
    gate, (best, *_) = _likeliest(state.rows, state, [])
    assert gate.start == start and best.evidence == evidence[start]


def started(gate):
    return None if gate.all() else "r_2"


@pytest.mark.parametrize(("law", "outdone"), [(499.0 + MARGIN, False), (501.0 + MARGIN, True)])
def test_a_law_that_exceeds_the_leader_by_the_margin_is_a_doubt(law, outdone, state, monkeypatch):
    monkeypatch.setattr(step_module, "judged", lambda rows, gate, found, *_: hypothesis(found))
    best = sorted([finding("payload", 500.0), finding("", law)], key=lambda each: -each.evidence)
    fits = {"payload": SimpleNamespace(rows=state.rows, finding=best[1])}
    step = Step._judged(state, state.rows, ALWAYS, best, fits, {}, {})
    assert step.outdone is outdone and step.leader.id == "payload"


@pytest.mark.parametrize(
    ("law", "beside", "most", "names"),
    [
        (529.0, True, 5, ["payload", "copper_loss"]),
        (531.0, True, 5, []),
        (531.0, False, 5, ["payload", "copper_loss"]),
        (531.0, False, 2, []),
    ],
)
def test_names_have_to_explain_as_much_as_a_law_if_they_leave_one(law, beside, most, names, state, monkeypatch):
    """Two names explain 490 in the tables and 590 by now, less margins of 60: a third one was superfluous.

    `beside`: a law passes beside all names; `most`: effects, after which no law is looked for.
    """
    before = replace(state, effects=())
    unknown = Unknown(finding("", law + MARGIN), ALWAYS, MARGIN)
    doubt, grown = Doubt(before, state.rows, unknown, ()), replace(state, unknown=unknown if beside else None)
    evidence = {"payload": 500.0, "copper_loss": 90.0}
    monkeypatch.setattr(search, "ranked", lambda rows, gate, own: [finding(own[0].id, evidence[own[0].id])])
    monkeypatch.setattr(search, "without", lambda rows, selected: rows)
    monkeypatch.setattr(search, "with_sessions", lambda _: state.rows)
    monkeypatch.setattr(search, "kinds_of", lambda *_: 40)
    monkeypatch.setattr(search, "_grown", lambda *_: (grown, doubt))
    monkeypatch.setattr(search, "_settled", lambda settled: settled)
    monkeypatch.setattr(search, "_by_law", lambda *_: law)
    setup = SimpleNamespace(gates=[ALWAYS], design=state.rows.design)
    selection = search.select(setup, Limits(max_effects=most), lambda _: None)
    assert [each.id for each in selection.effects] == names


@pytest.mark.parametrize(("left", "names"), [(MARGIN - 1, ["copper_loss"]), (MARGIN + 1, ["payload", "copper_loss"])])
def test_an_effect_below_the_margin_beside_later_ones_is_removed(left, names, state, monkeypatch):
    evidence = {"payload": left, "copper_loss": 400.0}

    def again(rows, gate, candidates):
        return [finding(each.id, evidence[each.id]) for each in candidates]

    monkeypatch.setattr(search, "ranked", again)
    monkeypatch.setattr(search, "without", lambda rows, selected: rows)
    monkeypatch.setattr(search, "_with_effects", lambda before, effects: replace(before, effects=effects))
    assert [each.id for each in _settled(state).effects] == names


def test_the_table_says_what_every_hypothesis_lacks_against_the_one_that_leads():
    """Whoever leads in the end: a law that takes the place of a name leads the table, too."""
    law, name, weak = finding("", 500.0), finding("contact_force", 300.0), finding("payload", 20.0)
    refused = replace(hypothesis(weak), status="refused", missing=("evidence above 30",))
    table = led_by((hypothesis(law), hypothesis(name), refused), name)
    assert [each.status for each in table] == ["candidate", "leads", "refused"]
    assert table[0].missing == ("a name: contact_force",) and table[2].missing == ("evidence above 30",)
    again = led_by(table, law)
    assert [each.status for each in again] == ["leads", "candidate", "refused"]
    assert again[1].missing == ("200 more evidence than a torque that depends on the angle of joint 1",)
    assert again[0].missing == () and again[2] == table[2]
    first = replace(refused, finding=finding("payload", 600.0))
    behind = led_by((first, hypothesis(finding("contact_force", 550.0)), hypothesis(law)), law)
    assert [each.missing for each in behind] == [first.missing, ("the largest evidence of all effects",), ()]


@pytest.mark.parametrize(
    ("ahead", "other", "leads"),
    [
        (4.0, "viscous_friction", "viscous_friction"),  # 0.15^2 of 1000, a 95 % limit, leaves 4.6 on average
        (5.0, "viscous_friction", "thermal_friction"),
        (4.0, "coulomb_friction", "thermal_friction"),  # another quantity
    ],
)
def test_a_free_shape_leads_by_more_than_wrong_columns_leave(ahead, other, leads, state, monkeypatch):
    monkeypatch.setattr(step_module, "judged", lambda rows, gate, found, *_: hypothesis(found))
    monkeypatch.setattr(step_module, "white_power", lambda *_: np.ones(4))
    best = [finding("thermal_friction", 1000.0), finding(other, 1000.0 - ahead)]
    fits = {each.candidate.id: SimpleNamespace(rows=state.rows, finding=each) for each in best}
    step = Step._judged(state, state.rows, ALWAYS, best, fits, {}, {})
    assert step.leader.id == leads
    assert [row.id for row in step.table if row.status == "leads"] == [leads]
    lacks = () if leads == "thermal_friction" else ("more evidence than wrong columns of viscous_friction leave",)
    assert step.table[0].missing == lacks
