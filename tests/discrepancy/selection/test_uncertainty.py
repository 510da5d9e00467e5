"""Intervals of sizes and fitted shapes."""

from dataclasses import replace

import numpy as np
import pytest

from acqd.discrepancy.regression.setup import Comparison, set_up
from acqd.discrepancy.repair.terms import reported
from acqd.discrepancy.repair.torque_scale import TorqueScale
from acqd.discrepancy.selection.forward_selection import Limits, select
from acqd.discrepancy.selection.shape_interval import Fit, Neighbours, fit_at
from acqd.discrepancy.selection.uncertainty import half_beside, intervals
from tests.builders import grey, recording
from tests.discrepancy.independent import COMMON, INDEPENDENT, column, extra_power, traced


@pytest.mark.slow
def test_size_and_shape_of_a_stribeck_curve_have_narrow_intervals_beside_the_truth(model, robot):
    def curve(scene, random):
        near = np.exp(-((scene.qd[:, 1] / 0.15) ** 2)) * scene.direction[:, 1]
        return extra_power(scene, column(scene, 1, 25.0 * near))

    _, selection = traced(model, robot, curve, only=COMMON | {"stribeck_friction"})
    named = selection.effects[0]
    assert (named.id, named.place.where) == ("stribeck_friction", "joint 2")
    certain = intervals(selection, named)
    assert certain.shape == pytest.approx(0.15, abs=0.005) and 0 < certain.shape_half < 0.02
    assert certain.coefficients[0] == pytest.approx(25.0, abs=4 * certain.half[0])
    assert 0 < certain.half[0] < 0.1 * certain.coefficients[0]


@pytest.fixture(scope="module")
def dry(model, robot):
    """The selection on recordings with dry friction of 8 Nm of joint 2."""

    def friction(scene, random):
        return extra_power(scene, column(scene, 1, 8.0 * np.tanh(scene.qd[:, 1] / 0.004)))

    return traced(model, robot, friction, only=COMMON)[1]


@pytest.mark.slow
@pytest.mark.xdist_group("dry friction")
def test_an_effect_without_a_fitted_shape_has_none(dry):
    selection = dry
    assert [(named.id, named.place.where) for named in selection.effects] == [("coulomb_friction", "joint 2")]
    certain = intervals(selection, selection.effects[0])
    assert certain.shape is None and certain.shape_half is None
    assert certain.coefficients[0] == pytest.approx(8.0, rel=0.1)


@pytest.mark.slow
def test_the_size_of_a_load_that_switches_is_not_attenuated_by_wrong_edges(model, robot):
    _, selection = traced(model, robot, INDEPENDENT["process_load"], only=COMMON | {"process_load"})
    (named,) = selection.effects
    indices, design = named.finding.candidate.indices, selection.design
    wrong = []
    for segment in range(len(design.columns.segments)):
        on = design.values(segment, indices)
        for edge in np.flatnonzero(np.diff(on[:, 0]))[::3]:
            on[edge - 10 : edge + 1] = on[edge + 1]
        wrong.append(on)
    selection = replace(selection, rows=selection.rows.on(design.with_replaced(indices, wrong)))
    certain = intervals(selection, named)
    assert abs(certain.coefficients[0] - 7.0) < 0.15 * 7.0
    column = fit_at(selection.design, selection.regression.without(named.key), named.finding.candidate, named.gate.open,
                    np.ones(len(design.parts)))  # fmt: skip
    assert column.coefficients[0] < 0.85 * 7.0


def test_a_cold_coefficient_is_that_of_the_start_of_the_session_also_where_its_first_recordings_are_held_out(robot):
    """Friction that dies out with 2.5 min, asked without the session's first 2 min."""
    model, begins_s = grey(), 1e9 + 5000

    def cold(scene, random):
        return extra_power(scene, column(scene, 0, 60 * scene.qd[:, 0] * np.exp(-(scene.t - begins_s) / 150)))

    reference = [recording(model, k, seed=1) for k in range(6)]
    new = [recording(model, k, cold, seed=2, start_s=begins_s) for k in range(2, 8)]
    only = frozenset(COMMON | {"thermal_friction", "viscous_friction"})
    comparison = Comparison(model, robot, new, reference, only, frozenset(), {"": begins_s})
    selection = select(set_up(comparison, lambda _: None), Limits(), lambda _: None)
    assert selection.effects[0].id == "thermal_friction"
    term = reported(selection, selection.effects[0], TorqueScale(1.0, 0.0)).term
    assert term.shape["origin_s"] == begins_s
    low, high = term.parameters["cold coefficient"]["ci95"]
    assert low < 60 < high and high < 80


@pytest.mark.parametrize(("drops", "known"), [((11.0, 12.0, 11.0), True), ((11.0, 11.4, 12.0), False)])
def test_a_shape_without_a_maximum_has_no_interval(monkeypatch, drops, known):
    fits = [Fit(np.ones(1), np.ones(1), drop) for drop in drops]
    monkeypatch.setattr(Neighbours, "_at", lambda self, number, weights: fits[number])
    fit = Neighbours(None, (0.1, 0.2, 0.3), (), (), ()).fit(np.ones(1))
    assert np.isfinite(fit.shape_variance) == known
    assert fit.shape == pytest.approx(0.2 if known else 0.3)


@pytest.mark.parametrize(("usual", "least", "most"), [(0.5, 0.87, 0.95), (1.0, 0.95, 0.99)])
def test_intervals_of_few_recordings_hold_and_are_narrower_than_those_of_a_jackknife_alone(usual, least, most):
    """The true scatter may be twice the usual one. Of three recordings, a jackknife alone is 4.3 errors wide."""
    values = np.random.default_rng(1).normal(0.0, 1.0, (20_000, 3))
    error, scatter = values.mean(axis=1), values.std(axis=1, ddof=1) / np.sqrt(3)
    half = half_beside(np.full(len(error), usual / np.sqrt(3)), scatter, 3)
    assert least < (np.abs(error) < half).mean() < most
    assert np.median(half) < 0.8 * 4.3 * np.median(scatter)
