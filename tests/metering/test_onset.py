"""Which f are doubted when f has begun to vary."""

from __future__ import annotations

import pytest

from acqd.metering.onset import Cycles, Onset

WAVY = Cycles(0.001, 0.003, 0.0, 0.0)
"""Bend and swell beside an interharmonic."""


def doubts(f, magnitude=None, explained=(), known=12):
    """Whether each f [Hz] is doubted, of windows that are remembered from the first one on."""
    onset, found = Onset(0.0075, 50, 11.0, edge=2, known=known), []
    for k in range(len(f)):
        seen = f[: k + 1]
        size = (magnitude or [1 + 0.001 * ((-1) ** j) for j in range(len(f))])[: k + 1]
        onset.note(max(seen) - min(seen), seen, size, WAVY, explained=k in explained)
        found.append(onset.doubted)
    return found


QUIET = [50.0 + 0.0005 * (-1) ** k for k in range(20)]


def test_f_that_is_back_where_it_was_is_right():
    assert doubts([*QUIET, 50.04, 49.97, 50.001, 50.03])[20:] == [True, True, False, True]


def test_f_that_is_near_all_that_are_remembered_is_right():
    assert doubts([*QUIET, 50.009, 50.0085, 50.011])[20:] == [False, False, True]


@pytest.mark.parametrize("first", [3, 8])
def test_a_few_windows_do_not_show_what_f_is(first):
    assert doubts([*QUIET[:first], 50.009])[-1]


def test_beside_an_interharmonic_that_was_known_no_step_of_f_is_seen():
    """Its beat is slow: magnitude and phase stand still for a moment, as they do when f itself has changed."""
    f = [*QUIET, *[50.02] * 4]
    still = [1.0] * 20 + [1.02] * 4
    calm = Onset(0.0075, 50, 11.0, edge=2, known=12)
    for k in range(len(f)):
        seen = f[: k + 1]
        calm.note(max(seen) - min(seen), seen, still[: k + 1], Cycles(1e-6, 1e-6, 0.0, 0.0), explained=k in (20, 21))
    assert calm.doubted
