"""Distances between hypotheses in evidence that chance and wrong columns may move."""

from __future__ import annotations

import numpy as np
import pytest

from acqd.discrepancy.selection.standing import LAW, Contender, Standing
from acqd.discrepancy.thresholds import THRESHOLDS

ONE, OTHER = np.array([1.0, 1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0, 1.0])
CHANCE = 10.0
KAPPA = THRESHOLDS.column_error


def test_hypotheses_at_other_times_are_chance_apart():
    standing = Standing.of([Contender("payload", 500.0, ONE), Contender("thermostat", 400.0, OTHER)], 500.0)
    assert standing.behind(CHANCE)["thermostat"] == pytest.approx(100 / CHANCE)
    assert standing.behind(CHANCE)["payload"] == pytest.approx(-100 / CHANCE)


def test_what_wrong_columns_could_move_is_no_lead():
    standing = Standing.of([Contender("payload", 5000.0, ONE), Contender("gravity_bias", 4900.0, 3 * ONE)], 9.0)
    assert standing.behind(CHANCE)["gravity_bias"] == pytest.approx(100 / (CHANCE + KAPPA**2 * 5000))
    assert standing.behind(CHANCE, 0.5)["payload"] == pytest.approx(-100 / (CHANCE + 0.5 * KAPPA**2 * 5000))


def test_the_strongest_rival_counts():
    law = Contender(LAW, 450.0, OTHER)
    standing = Standing.of([Contender("payload", 500.0, ONE), law, Contender("thermostat", 10.0, OTHER)], 9.0)
    assert standing.behind(CHANCE)["payload"] == pytest.approx(-50 / CHANCE)
    assert standing.behind(CHANCE)[LAW] == pytest.approx(50 / CHANCE)
    with_law = (450 - 10) / (CHANCE + KAPPA**2 * 450)
    assert standing.behind(CHANCE)["thermostat"] == pytest.approx(max(490 / CHANCE, with_law))


def test_a_hypothesis_alone_stands_before_nothing():
    assert Standing.of([Contender("payload", 50.0, ONE)], 40.0).behind(CHANCE)["payload"] == -5.0


def test_a_standing_survives_json():
    standing = Standing.of(
        [Contender("payload", 500.0, ONE, ("coulomb_friction", 0.3)), Contender(LAW, 400.0, ONE + OTHER)], 5.0
    )
    assert Standing.from_json(standing.as_json()) == standing
