"""Columns that a driver publishes without measuring them, and values that are measurements."""

import numpy as np
import pytest

from acqd.robot.columns import at_zero, judged, on_off
from acqd.robot.description import load_description

ROBOT = load_description("ur10e")
T = 0.01 * np.arange(2000)
RATES = np.linspace(0.7, 1.9, 6)
Q = np.sin(T[:, None] * RATES)
TAU = 40 * np.cos(T[:, None] * RATES) + np.random.default_rng(0).normal(0, 0.3, (2000, 6))


def in_rows(share, number):
    """Torques with a number for all joints in a share of the rows."""
    return np.where(np.random.default_rng(1).random((len(T), 1)) < share, number, TAU)


def refreshed_every(rows):
    return TAU[np.arange(len(T)) // rows * rows]


@pytest.mark.parametrize(
    ("tau", "line"),
    [
        (in_rows(0.3, 0.0), "the torque is one number for all joints in"),
        (in_rows(0.02, 999.9), "the torque is one number for all joints in"),
        (np.where(T[:, None] > 10, TAU[1000], TAU), "the torque stays as it was in"),
        (refreshed_every(100), "the torque stays as it was in"),
    ],
)
def test_torques_that_were_not_measured_in_some_rows_are_not_used(tau, line):
    assert judged(T, Q, {"tau": tau}, ROBOT).unusable["tau"].startswith(line)


def test_a_joint_without_any_number_is_said():
    current = np.where(np.arange(6) == 2, np.nan, TAU)
    assert judged(T, Q, {"current": current}, ROBOT).unusable == {
        "current": "the current of elbow has no number in any row"
    }


def test_torques_of_a_drivers_arithmetic_are_not_measured():
    found = judged(T, Q, {"tau": 1e-12 * TAU}, ROBOT)
    assert found.unmeasured == {"tau": "the torque of every joint"} and found.gone == {"tau"}


@pytest.mark.parametrize(
    "tau",
    [TAU, np.round(TAU, 1), np.round(TAU), refreshed_every(4), np.where(np.arange(2000)[:, None] % 700, TAU, 0.0)],
)
def test_measured_torques_stay_also_with_few_digits_or_seldom_refreshed(tau):
    assert not judged(T, Q, {"tau": tau}, ROBOT).gone


@pytest.mark.parametrize("alone", [False, True])
def test_rests_and_coarse_numbers_are_measured(alone):
    """Rows of 0.1 s, of an arm that rests between its moves: at the ends of a rest, values may be those of the rest."""
    speed = np.clip(np.minimum(T % 2.5, 1.5 - T % 2.5) / 0.05, 0, 1)  # up and down within a row
    joints = np.random.default_rng(2).uniform(-1, 1, (9, 6)) * (1.0 if not alone else np.arange(6) == 5)
    qd = speed[:, None] * joints[(T // 2.5).astype(int)]
    q, rows = 0.01 * np.cumsum(qd, axis=0), np.arange(0, 2000, 10)
    tau = np.round(20 * np.sin(q) + 3 * np.sign(qd)) * (speed > 0)[:, None]  # closed brakes hold the arm
    late = {"qd": np.roll(qd, 10, axis=0), "tau": np.roll(tau, 10, axis=0)}
    for values in ({"qd": qd, "tau": tau}, late):
        some = {name: each[rows] for name, each in values.items()}
        assert not {"tau", "qd"} & judged(T[rows], q[rows], some, ROBOT).gone


def test_a_force_that_stays_at_constant_speed_stays():
    gantry = load_description("ur10e").model_copy(update={"joint": ROBOT.joint[:1]})
    q = 0.1 * np.abs((T % 8) - 4)[:, None]  # to and fro, at one speed
    force = np.round(5 * np.sign(np.gradient(q[:, 0])), 1)[:, None]
    assert not judged(T, q, {"tau": force}, gantry).gone


def test_temperatures_below_every_robots_are_left_out():
    assert "-273 degC" in judged(T, Q, {"temperature": np.full(Q.shape, -273.15)}, ROBOT).unusable["temperature"]
    assert not judged(T, Q, {"temperature": np.full(Q.shape, 25.0)}, ROBOT).gone


@pytest.mark.parametrize(
    ("levels", "expected"),
    [([0, 1], [0, 1]), ([0, 255], [0, 1]), ([-1, 0], [1, 0]), ([-1, 1], [0, 1]), ([255, 255], [1, 1]),
     ([0.2, 0.7], [0.2, 0.7]), ([-1, -1], None), ([2, 3], None), ([np.nan], None)],
)  # fmt: skip
def test_a_signal_has_two_levels(levels, expected):
    found = on_off(np.array(levels, dtype=float))
    assert found is None if expected is None else found.tolist() == expected


def test_a_joint_at_zero_in_every_row_is_named_where_others_move():
    assert at_zero(np.where(np.arange(6) == 4, 0.0, Q), ROBOT) == ("wrist_2",)
    assert at_zero(Q, ROBOT) == at_zero(np.zeros((50, 6)), ROBOT) == ()
