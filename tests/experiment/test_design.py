"""What a designed program is worth beside what the report has said."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from acqd.experiment.design import Asked, Designed, Outlook
from acqd.experiment.page import _bars, headline, steps


def designed(now, after, *, unanswered, named=(), asked=()):
    """A program that promises a probability of the right name after, where the recordings so far promise `now`."""
    so_far, then = (Outlook(np.array([share]), [""], ()) for share in (now, after))
    question = SimpleNamespace(open=unanswered, named=named)
    motion, causes = SimpleNamespace(seconds=120.0), (SimpleNamespace(believed=1.0),)
    return Designed(question, Asked(causes=asked), None, False, causes, (), motion, so_far, then, so_far, so_far)


@pytest.mark.parametrize(
    ("now", "after", "unanswered", "needed", "decides"),
    [
        (0.97, 0.98, False, False, False), (0.97, 0.98, True, True, True), (0.93, 0.96, True, True, True),
        (0.14, 0.92, True, True, True), (0.14, 0.16, True, True, False),
    ],
)  # fmt: skip
def test_a_report_that_is_open_needs_an_answer_whatever_its_recordings_should_have_told(
    now, after, unanswered, needed, decides
):
    program = designed(now, after, unanswered=unanswered)
    assert (program.needed, program.decides) == (needed, decides)


@pytest.mark.parametrize(("seconds", "cut_s"), [(179.2, 44.8), (57.0, 14.25), (9.0, 5.0)])
def test_the_lines_to_type_make_several_recordings_of_a_program(seconds, cut_s):
    program = replace(designed(0.1, 0.9, unanswered=True), motion=SimpleNamespace(seconds=seconds))
    assert program.cut_s == pytest.approx(cut_s)


def test_the_page_does_not_call_a_report_settled_that_is_open():
    assert "no motion has to decide" in headline(designed(0.97, 0.98, unanswered=False))
    assert "leaves them open" in headline(designed(0.97, 0.98, unanswered=True))
    assert steps(designed(0.97, 0.98, unanswered=False)) == []


def test_a_bar_is_as_long_as_its_probability():
    bars = _bars(designed(0.2, 0.83, unanswered=True))
    assert [row.share(bars.longest) for row in bars.rows] == [83.0, 20.0, 20.0, 20.0]


def test_a_report_whose_name_is_not_in_doubt_asks_for_no_motion_whatever_else_could_be_there():
    named = (("payload", "flange"),)
    program = designed(0.0, 0.0, unanswered=False, named=named)
    assert "payload (flange)" in headline(program) and not program.needed and steps(program) == []
    assert designed(0.0, 0.0, unanswered=False, named=named, asked=("gravity_bias",)).needed
