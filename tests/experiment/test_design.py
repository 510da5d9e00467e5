"""What a designed program is worth beside what the report has said."""

from dataclasses import dataclass
from types import SimpleNamespace

import numpy as np
import pytest

from acqd.discrepancy.regression.least_squares import Moments
from acqd.experiment.design import Designed, Outlook, _Session
from acqd.experiment.page import headline, steps
from acqd.experiment.pieces import Piece


def designed(now, after, *, unanswered):
    """A program that promises a probability of the right name after, where the recordings so far promise `now`."""
    so_far, then = (Outlook(np.array([share]), [""], ()) for share in (now, after))
    question = SimpleNamespace(open=unanswered)
    motion, causes = SimpleNamespace(seconds=120.0), (SimpleNamespace(believed=1.0),)
    return Designed(question, None, None, False, causes, (), motion, so_far, then, so_far, so_far)


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


def test_the_page_does_not_call_a_report_settled_that_is_open():
    assert "no motion has to decide" in headline(designed(0.97, 0.98, unanswered=False))
    assert "leaves them open" in headline(designed(0.97, 0.98, unanswered=True))
    assert steps(designed(0.97, 0.98, unanswered=False)) == []


@dataclass(frozen=True)
class Promised:
    """A contest whose right name is as likely as the information of a program."""

    another: bool = False
    causes = (SimpleNamespace(believed=1.0),)

    def probabilities(self, moments):
        return np.minimum(moments.normal[0], 1.0)

    def score(self, moments):
        return float(self.probabilities(moments)[0])

    def closest(self, moments):
        return [""]


@pytest.mark.parametrize(("of_a_turn", "program"), [(0.3, ["random"] * 2), (0.32, ["random"] * 2), (0.5, [])])
def test_random_motion_that_promises_as_much_is_preferred(of_a_turn, program):
    information = {"turn": of_a_turn, "random": 0.3, "another": 0.1}
    pieces = {name: Piece(name, name != "turn", (), 10.0) for name in information}
    moments = {name: Moments(*(np.full((1, 1), value) for _ in range(3))) for name, value in information.items()}
    so_far = Moments(*(np.zeros((1, 1)) for _ in range(3)))
    session = _Session(False, Promised(), so_far, pieces, moments, ["turn", "turn"])
    assert session.of_random_motion() == program
