"""The soak's judges: budgets, order, usage."""

from __future__ import annotations

import os

import pytest

from tools.studies.soak.budgets import figures, theil_sen
from tools.studies.soak.listener import out_of_order
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
