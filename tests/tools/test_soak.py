"""The soak's judges: budgets, order, usage."""

from __future__ import annotations

import os

import pytest

from tools.studies.soak.budgets import figures, theil_sen
from tools.studies.soak.listener import out_of_order
from tools.studies.soak.paper import extrapolated
from tools.studies.soak.usage import Sample, Usage, usage


def samples(rss=lambda hour: 100.0, descriptors=lambda hour: 20, lines=lambda hour: 5, stored=lambda hour: 0.5):
    """An hour with a sample every minute."""
    hours = [minute / 60 for minute in range(61)]
    return [
        Sample(3600 * h, "daemon", Usage(int(1e6 * rss(h)), descriptors(h), 3), lines(h), int(1e6 * stored(h)))
        for h in hours
    ]


@pytest.mark.parametrize(
    ("changes", "exceeded"),
    [
        ({}, set()),
        ({"rss": lambda h: 100 + (50 if 0.5 < h < 0.55 else 0)}, set()),
        ({"rss": lambda h: 100 + min(h, 0.1) * 300}, set()),
        ({"rss": lambda h: 100 + 6 * h}, {"memory, growth over the run"}),
        ({"descriptors": lambda h: 20 + int(10 * h)}, {"descriptors, growth"}),
        ({"lines": lambda h: int(1000 * h)}, {"log lines"}),
        ({"stored": lambda h: 5 * h}, {"spool, most"}),
    ],
)
def test_a_budget_is_exceeded_by_what_grows_and_by_nothing_else(changes, exceeded):
    assert {figure.name for figure in figures("daemon", samples(**changes)) if figure.met is False} == exceeded


def test_slope_of_a_line_with_outliers():
    hours = [k / 10 for k in range(100)]
    assert theil_sen(hours, [3 * h + (1000 if k % 10 == 0 else 0) for k, h in enumerate(hours)]) == pytest.approx(3)


@pytest.mark.parametrize(
    ("numbers", "wrong"),
    [([1, 2, 3], 0), ([1, 100, 2, 101, 3], 0), ([1, 2, 2, 1, 3], 0), ([5, 100, 4], 0), ([5, 100, 4, 3, 101], 1)],
)
def test_backlog_and_new_rows_are_two_rising_sequences(numbers, wrong):
    assert out_of_order(numbers) == wrong


def test_usage_of_this_process():
    now = usage(os.getpid())
    assert now is not None and now.rss > 1 << 20 and now.descriptors > 2 and now.threads >= 1
    assert usage(2**22 + 1) is None


MEASURED = {
    "stored": 5000.0, "CPU of sinks": 20.0, "CPU of mosquitto": 10.0, "CPU of PostgreSQL": 25.0,
    "a row as a packet of MQTT": 250.0, "a row in PostgreSQL's log": 300.0,
    "a row in PostgreSQL, with its indices": 200.0, "roll-ups (acqd sink maintain), time per row": 5.0,
    "deletion, time per row": 2.0,
}  # fmt: skip


def test_a_plan_on_paper_is_proportional_to_the_load():
    plan = {figure.name: figure.value for figure in extrapolated(MEASURED, 10_000, 30.0, 0.5)}
    assert plan["rows"] == 1_000_000 and plan["sinks"] == 80 and plan["devices for each of the sinks"] == 125
    assert plan["cores for PostgreSQL"] == 100 and plan["network into the brokers"] == pytest.approx(2.0)
    assert plan["tables, 30 days"] == pytest.approx(30 * 86_400 * 200e-6)
    assert plan["devices, with 4 h for the nightly run"] == 138
    less = {figure.name: figure.value for figure in extrapolated(MEASURED, 10, 30.0, 0.5)}
    assert less["sinks"] == less["cores for PostgreSQL"] == 1


def test_a_plan_needs_every_figure():
    with pytest.raises(KeyError):
        extrapolated({"stored": 5000.0}, 10, 30.0, 0.5)
