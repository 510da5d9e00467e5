"""Effects by name and text."""

import pytest

from acqd.errors import UserError
from acqd.lab.effects import parse_effect


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("paylod", "effect 'paylod' is unknown; did you mean payload"),
        ("xyzzy", "effect 'xyzzy' is unknown; known: brake_holding"),
        ("payload:mass=1", "effect payload: 'mass' is not one of mass_kg=, with_tool=, from=, at="),
        ("payload:mass_kg=heavy", "'mass_kg=heavy' is not like name=1.5"),
        ("payload:mass_kg", r"'mass_kg' is not like name=1.5 .no =."),
        ("payload:mass_kg=-2", r"mass_kg=-2 is outside 0.001 .. 1000"),
        ("thermostat:period_s=0", r"period_s=0 is outside 1 .. 100000"),
        ("clock_drift:at=3", "it can only start with a recording"),
        ("payload:mass_kg=nan", "is not a finite number"),
        ("payload:from=0", "expected a recording number from 1"),
    ],
)
def test_a_wrong_effect_is_named(text, complaint):
    with pytest.raises(UserError, match=complaint):
        parse_effect(text)
