"""The search: effects made by independent expressions are named, noise and the unknown are not."""

from dataclasses import replace

import numpy as np
import pytest

from acqd.discrepancy.regression.setup import Comparison, set_up
from acqd.discrepancy.selection import forward_selection
from acqd.discrepancy.selection.forward_selection import Limits
from acqd.discrepancy.selection.judging import kinds_of
from acqd.discrepancy.selection.session_columns import with_sessions
from acqd.discrepancy.selection.step import State
from acqd.models.effects import library
from acqd.models.effects.substeps import averaged
from tests.builders import recording
from tests.discrepancy.independent import (
    COMMON,
    INDEPENDENT,
    added_payload,
    extra_power,
    lagged_mean,
    mass_torque_of_link,
    payload_torque,
    selected,
    since_release,
    traced,
)

QUICK = {"copper_loss", "line_voltage"}
MORE = {"process_load": 7, "mechanical_power": 7, "stribeck_friction": 6}
"""Recordings of effects that fewer do not show for certain."""
SIZES = {
    "coulomb_friction": (4.0, {"rel": 0.1}), "payload": (2.0, {"rel": 0.1}), "gear_ripple": (17.3, {"abs": 0.1}),
    "thermostat": (47.0, {"rel": 0.1}), "mounting": (0.684, {"rel": 0.1}), "joint_zero": (0.06, {"rel": 0.1}),
}  # fmt: skip
"""Nm, kg, periods per turn, s, m/s^2 and rad, with the tolerance."""
ALWAYS = {"payload", "coulomb_friction", "copper_loss"}
"""The others are slow tests: they run when the loop, or what it imports, has changed."""


@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=[] if name in ALWAYS else pytest.mark.slow) for name in sorted(INDEPENDENT)],
)
def test_an_effect_that_was_made_otherwise_is_named_first(name, model, robot):
    amount = {"count": 14, "rows": 700} if name == "thermostat" else {"count": 4, "rows": 450}
    amount |= {"count": MORE[name]} if name in MORE else {}
    only = COMMON | {name, *library()[name].neighbours}
    _, selection = traced(model, robot, INDEPENDENT[name], **({} if name in QUICK else amount), only=only)
    assert [named.id for named in selection.effects][:1] == [name], (
        selection.verdict,
        [row.as_text() for row in selection.table],
    )
    if name in SIZES:
        value, tolerance = SIZES[name]
        shape, size = selection.effects[0].shape, selection.effects[0].finding.coefficients[0]
        assert shape.get("period_s", shape.get("periods_per_turn", size)) == pytest.approx(value, **tolerance)


@pytest.mark.slow
def test_a_lower_standby_power_does_not_hide_a_friction(model, robot):
    """Until the standby has a name, added friction makes the error in W larger; about the mean of a block it falls."""

    def both(scene, random):
        return INDEPENDENT["viscous_friction"](scene, random) - 25.0

    only = COMMON | {"viscous_friction", "thermal_friction"}
    _, selection = traced(model, robot, both, only=only)
    assert {named.id for named in selection.effects} == {"viscous_friction", "offset_shift"}


def test_an_effect_gives_its_place_to_one_that_leads_beside_the_later_ones(model, robot):
    """The order in which effects were selected decides nothing: here the right one was missing at first."""

    def both(scene, random):
        return INDEPENDENT["viscous_friction"](scene, random) - 25.0

    sides = [[recording(model, k, add, rows=450, seed=n, start_s=1e9 + 5000 * n) for k in range(4)]
             for n, add in enumerate((None, both))]  # fmt: skip
    only = frozenset({"viscous_friction", "coulomb_friction", "offset_shift"})
    setup = set_up(Comparison(model, robot, sides[1], sides[0], only, frozenset()), lambda _: None)
    columns = setup.design.columns
    fewer = replace(columns, candidates=[c for c in columns.candidates if c.id != "viscous_friction"])
    rows = with_sessions(replace(setup, design=replace(setup.design, columns=fewer)))
    state = State(rows, rows, tuple(setup.gates), kinds_of(columns.candidates))
    state, _ = forward_selection._grown(state, Limits(2), lambda _: None)
    assert {each.id for each in state.effects} == {"coulomb_friction", "offset_shift"}
    known = replace(state, rows=replace(state.rows, design=replace(state.rows.design, columns=columns)))
    settled = forward_selection._settled(known)
    assert {each.id for each in settled.effects} == {"viscous_friction", "offset_shift"}
    assert len(settled.steps) == len(known.steps) + 1


@pytest.mark.slow
def test_a_large_change_is_named_in_three_recordings(model, robot):
    """Three recordings cannot surprise; the change must stand out from unchanged sessions, which know nothing of it."""

    def heavy(scene, random):
        return extra_power(scene, payload_torque(scene, 6.0))

    _, selection = traced(model, robot, heavy, count=3, rows=1400, only=COMMON | {"gravity_bias"})
    assert [named.id for named in selection.effects] == ["payload"], [row.as_text() for row in selection.table]


def test_a_small_drift_of_the_clock_is_no_offset(model, robot):
    """Power is 18 ms late after seven minutes: too little for the alignment, and in every recording another delay."""

    def drifting(scene, random):
        t = averaged(scene.t)
        late_s = 0.018 * (t - (1e9 + 5000)) / 420
        return np.interp(t - late_s, t, scene.predicted) - scene.predicted

    _, selection = traced(model, robot, drifting, count=7, only=COMMON | {"clock_drift"})
    assert [named.id for named in selection.effects] == ["clock_drift"], [row.as_text() for row in selection.table]
    error = 1.4e-3 * 3600 / 420  # two alignments differ by so much, over seven minutes
    assert selection.effects[0].finding.coefficients[0] == pytest.approx(0.018 * 3600 / 420, abs=2 * error)


@pytest.mark.slow
@pytest.mark.parametrize(("link", "where"), [(1, "link 2"), (2, "link 3")])
def test_a_mass_on_an_upper_link_has_inertia_and_is_no_payload(model, robot, link, where):
    def heavier(scene, random):
        return extra_power(scene, mass_torque_of_link(scene, link, 4.0))

    _, selection = traced(model, robot, heavier, only=COMMON | {"gravity_bias"})
    named = selection.effects[0]
    assert named.id == "gravity_bias" and named.place.where in (where, f"{where}, beside its centre")
    assert len(selection.effects) == 1 and named.finding.coefficients[0] == pytest.approx(4.0, rel=0.1)


def test_nothing_is_found_where_nothing_is(model, robot):
    _, selection = traced(model, robot, None)
    assert selection.verdict == "nothing_left", [named.id for named in selection.effects]


@pytest.mark.slow
def test_what_the_library_does_not_know_is_called_unknown(model, robot):
    def band(scene, random):
        return lagged_mean(6.0 * np.exp(-(((np.abs(scene.qd[:, 1]) - 0.3) / 0.06) ** 2)))

    _, selection = traced(model, robot, band)
    assert selection.verdict == "unknown_structure", [(n.id, n.finding.candidate.label) for n in selection.effects]
    assert selection.unknown.finding.candidate.label == "the speed of joint 2"


@pytest.mark.slow
def test_friction_that_grows_with_the_third_power_of_speed_is_not_called_viscous(model, robot):
    def cubic(scene, random):
        torque = np.zeros_like(scene.qd)
        torque[:, 1] = 12.0 * scene.qd[:, 1] ** 3
        return extra_power(scene, torque)

    _, selection = traced(model, robot, cubic, only=COMMON | {"viscous_friction", "coulomb_friction"})
    assert selection.verdict == "unknown_structure", [(n.id, n.finding.candidate.label) for n in selection.effects]
    assert selection.unknown.finding.candidate.label == "a friction of joint 2 of another curve over its speed"


@pytest.mark.slow
@pytest.mark.parametrize("form", ["square", "sine"])
def test_a_regular_load_of_seconds_is_a_pulsation_and_no_thermostat(model, robot, form):
    """A sine has no edges: what switches or touches at the same moments had taken its place."""

    def pump(scene, random):
        cycles = averaged(scene.t) / 5.0 + random.uniform()
        return 8.0 * (cycles % 1.0 < 0.4) if form == "square" else 8.0 * np.sin(2 * np.pi * cycles)

    only = COMMON | {"thermostat", "process_load", "contact_force"}
    _, selection = traced(model, robot, pump, rows=600, only=only)
    assert selection.verdict == "unknown_structure", [(n.id, n.finding.candidate.label) for n in selection.effects]
    label = selection.unknown.finding.candidate.label
    period_s = float(label.removeprefix("a pulsation with a period of about ").removesuffix(" s"))
    assert period_s == pytest.approx(5.0, rel=0.03)


@pytest.mark.slow
def test_two_effects_are_both_named(model, robot):
    def both(scene, random):
        return added_payload(scene, random) + INDEPENDENT["thermostat"](scene, random)

    only = COMMON | {"thermostat", *library()["thermostat"].neighbours, *library()["payload"].neighbours}
    _, selection = traced(model, robot, both, rows=800, only=only)
    assert {named.id for named in selection.effects} == {"payload", "thermostat"}


def surge(scene, random):
    """A peak of hundreds of watts, of another height each time."""
    return random.uniform(0.97, 1.03) * lagged_mean(
        500.0 * (since_release(scene) >= 0) * np.exp(-since_release(scene) / 0.13)
    )


@pytest.mark.slow
def test_what_a_peak_leaves_over_hides_nothing_and_names_nothing(model, robot):
    def both(scene, random):
        return surge(scene, random) + 0.15 * added_payload(scene, random)

    _, selection = traced(model, robot, both, only=COMMON | {"brake_release", "gravity_bias"})
    assert [named.id for named in selection.effects] == ["brake_release", "payload"]


@pytest.mark.slow
def test_an_onset_within_the_dataset_is_found(model, robot):
    in_question = [recording(model, k, added_payload if k >= 5 else None, rows=500, seed=2) for k in range(10)]
    _, selection = selected(model, robot, in_question, [], COMMON)
    assert selection.effects[0].id == "payload"
    assert selection.effects[0].gate.start == "r_2_05"
