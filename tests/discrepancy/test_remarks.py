"""What a report says besides the verdict."""

from types import SimpleNamespace

import numpy as np
import pytest

from acqd.discrepancy.remarks import largely_unexplained
from acqd.discrepancy.repair.usual_error import UsualError


def said(rest_W, *ids, grown=True, usual=UsualError((1.0, 1.1), 1.0)):  # noqa: B008
    named = [SimpleNamespace(term=SimpleNamespace(id=name)) for name in ids]
    improved = SimpleNamespace(named=named, errors=[np.full(9, rest_W)])
    return largely_unexplained(improved, [np.full(9, 3.0)], usual, grown=grown)


def test_names_that_explain_less_than_half_of_the_growth_are_doubted():
    (line,) = said(2.9, "payload")
    assert "explains 7% of" in line and "2.90 W remain on held-out recordings, 1.00 W in the reference" in line


@pytest.mark.parametrize("known", [
    said(1.5, "payload"),  # most is explained
    said(2.8, "payload", grown=False),  # the rest is usual
    said(2.8, "payload", "contact_force"),  # nothing predicts when a contact acts
    said(2.8),  # no name
    said(2.8, "payload", usual=UsualError((), 1.0)),  # nothing to compare with
])  # fmt: skip
def test_other_reports_say_nothing(known):
    assert known == []
