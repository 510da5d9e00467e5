"""Axes that count otherwise than the description, torques of another unit, one log in another order than the others."""

import numpy as np
import pytest

from acqd.dataset.column_check import check_each, judge_logs
from acqd.errors import UserError
from acqd.robot.description import load_description
from acqd.robot.inertia import inverse_dynamics
from acqd.robot.log_reader import log_of
from acqd.robot.table import Table

ROBOT = load_description("ur10e")
NAMES = ["time", *(f"q{k}" for k in range(1, 7)), *(f"tau{k}" for k in range(1, 7))]


def motions():
    """Four simulated logs of 24 s: times, angles, torques with friction and noise."""
    for seed in range(4):
        rng = np.random.default_rng(seed)
        t = np.arange(0, 24, 0.02)
        w, phase = rng.uniform(0.5, 2.0, (2, 3, 6))
        q = np.array([0, -1.2, 1.0, -0.5, 0.4, 0.2])
        q = q + (0.4 * np.sin(t[:, None, None] * w + 3 * phase) / (0.5 + w)).sum(axis=1)
        qd = np.gradient(q, t, axis=0)
        tau = inverse_dynamics(ROBOT, q, qd, np.gradient(qd, t, axis=0)) + 3 * np.tanh(qd / 0.02)
        yield t, q, tau + rng.normal(0, 0.3, tau.shape)


@pytest.fixture(scope="module")
def recorded():
    return list(motions())


def logs(recorded, tmp_path, change):
    return [
        log_of(tmp_path / f"{k}.csv", Table(NAMES, np.column_stack([t, *change(k, q, tau)]), np.arange(len(t))), ROBOT)
        for k, (t, q, tau) in enumerate(recorded)
    ]


def reversed_elbow(_, q, tau):
    sign = np.array([1, 1, -1, 1, 1, 1])
    return sign * q, sign * tau


@pytest.mark.parametrize(
    ("change", "line"),
    [
        (reversed_elbow, "the other sign in the angle of elbow"),
        (lambda _, q, tau: (q + np.pi / 2 * (np.arange(6) == 1), tau), "-90 deg added in the angle of shoulder_lift"),
        (lambda _, q, tau: (q, tau / 100), "at the motor before the gear"),
        (lambda _, q, tau: (q, 1000 * tau), "in mNm"),
        (lambda k, q, tau: (q, np.random.default_rng(k).normal(0, 0.01, tau.shape)), "noise of a joint"),
    ],
)
def test_axes_and_torques_that_count_otherwise_are_refused_with_what_fits(recorded, tmp_path, change, line):
    with pytest.raises(UserError, match=line):
        judge_logs(logs(recorded, tmp_path, change), ROBOT)


def test_one_log_in_another_order_is_refused_alone_with_its_order(recorded, tmp_path):
    def exchanged(k, q, tau):
        order = [2, 1, 0, 3, 4, 5] if k == 1 else list(range(6))
        return q[:, order], tau[:, order]

    found = check_each(logs(recorded, tmp_path, exchanged), ROBOT)
    assert [path.name for path in found] == ["1.csv"]
    assert "shoulder_pan and elbow exchanged" in next(iter(found.values()))
    assert check_each(logs(recorded, tmp_path, lambda _, q, tau: (q, tau)), ROBOT) == {}
