"""What a report says besides the verdict."""

from types import SimpleNamespace

import numpy as np
import pytest

from acqd.discrepancy import remarks
from acqd.discrepancy.remarks import largely_unexplained
from acqd.discrepancy.repair.usual_error import UsualError

USUAL = UsualError((1.0, 1.1), 1.0)


@pytest.fixture
def said(monkeypatch):
    """The line of effects that leave `rest_W` of 3 W; their power is `timed_W` in the recordings of the search."""
    power = {}
    monkeypatch.setattr(remarks, "power_in_question", lambda *_: [np.full(5, power["W"])])

    def line(rest_W, *ids, grown=True, usual=USUAL, timed_W=0.0):
        power["W"] = timed_W
        named = [SimpleNamespace(term=SimpleNamespace(id=name, where="here")) for name in ids]
        gate = SimpleNamespace(open=None)
        effects = [SimpleNamespace(id=n, place=SimpleNamespace(where="here"), finding=None, gate=gate) for n in ids]
        improved = SimpleNamespace(named=named)
        selection = SimpleNamespace(effects=effects, design=None)
        return largely_unexplained(selection, improved, [np.full(9, 3.0)], [np.full(9, rest_W)], usual, grown=grown)

    return line


def test_names_that_explain_less_than_half_of_the_growth_are_doubted(said):
    (line,) = said(2.9, "payload")
    assert "explains 7.4 % of" in line and "2.90 W remain on held-out recordings, 1.00 W in the reference" in line
    assert said(1.5, "payload") == []
    assert said(2.9, "payload", grown=False) == [] and said(2.9) == []
    assert said(2.9, "payload", usual=UsualError((), 1.0)) == []


def test_power_at_times_that_nothing_predicts_counts_as_it_is(said):
    assert said(3.0, "contact_force", timed_W=2.5) == []
    (line,) = said(3.0, "thermostat", timed_W=0.8)
    assert "explains 8.0 % of" in line
