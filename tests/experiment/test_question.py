"""What the report has named takes no part in the question that is left."""

from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from acqd.discrepancy.selection.ranking import Rows
from acqd.experiment import question


@dataclass
class Witness:
    """Of torques; remembers what it was given."""

    known: tuple[Any, ...] = ()

    def sees(self, name):
        return name != "copper_loss"

    def given(self, name, variant):
        return Witness((*self.known, (name, variant)))


@dataclass
class Design:
    """With one candidate."""

    columns: Any
    witness: Witness | None
    blocks: Any = None


@dataclass
class Regression:
    """Columns that are free."""

    free: list[int] = field(default_factory=list)

    def with_columns(self, blocks, columns):
        return Regression([*self.free, *(column.index for column in columns)])

    def on(self, blocks):
        return self


@pytest.mark.parametrize(
    ("name", "witness", "known"),
    [
        ("payload", Witness(), (("payload", "scanned"),)), ("copper_loss", Witness(), ()), ("payload", None, None),
    ],
)  # fmt: skip
def test_a_named_effect_is_free_in_power_and_in_torques(monkeypatch, name, witness, known):
    candidate = SimpleNamespace(id=name, label="flange", indices=[4, 5], key="1", fitted=None, variant="scanned")
    monkeypatch.setattr(question, "ranked", lambda rows, gate, own: [SimpleNamespace(candidate=each) for each in own])
    design: Any = Design(SimpleNamespace(candidates=[candidate]), witness)
    regression: Any = Regression()
    rows = question._with_named(Rows(design, regression, 1.0), np.ones(1), ((name, "flange"),))
    assert rows.regression.free == [4, 5]
    assert (rows.design.witness and rows.design.witness.known) == known
