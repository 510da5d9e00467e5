"""A declared voltage that the recording never has is doubted; a healthy, disturbed or dead one is not."""

from __future__ import annotations

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from acqd.daemon.events.of_recording import doubt_of_voltage
from acqd.daemon.events.section import EventsSection

FILE = Path("scope.csv")


def doubt(volts, **section):
    batch = SimpleNamespace(Vrms=np.array([volts], dtype=float))
    return doubt_of_voltage(FILE, EventsSection(enabled=True, **section), batch)


@pytest.mark.parametrize(
    ("declared", "usual"), [(23.0, "1000 %"), (2300.0, "10 %"), (400.0, "57 %"), (120.0, "192 %"), (3470.0, "7 %")]
)
def test_another_voltage_than_that_of_any_window_is_doubted(declared, usual):
    [note] = doubt([230.0, 231.0, np.nan, 229.0], declared_voltage=declared)
    assert note.startswith("scope.csv: no window of L1") and usual in note and f"{declared:g} right?" in note


def test_what_a_supply_does_is_not_doubted():
    assert doubt([207.0] * 5, declared_voltage=230.0) == doubt([253.0] * 5, declared_voltage=230.0) == []
    fault = [230.0, *[70.0] * 200]  # a recorder that was triggered by a fault begins before it
    dead = [0.5] * 50
    assert doubt(fault, declared_voltage=230.0) == doubt(dead, declared_voltage=230.0) == []
    assert doubt([230.0] * 5, declared_voltage=400.0, line_to_line=True) == []
    assert doubt([230.0] * 5, sliding_reference=True) == doubt([np.nan], declared_voltage=230.0) == []
