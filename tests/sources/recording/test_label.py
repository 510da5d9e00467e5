"""What names of channels may mean."""

from __future__ import annotations

import pytest

from acqd.sources.recording.label import readings


@pytest.mark.parametrize("name", ["V12", "V1-2", "u1-2 (V)", "V1-V2", "VA-B", "U L1-L2"])
def test_two_phases_are_a_voltage_between_lines(name):
    first = readings(name)[0]
    assert (first.kind, first.phases) == ("line", (1, 2))


@pytest.mark.parametrize("name", ["V1-N", "U1-1", "I1-2", "IA-1", "V1"])
def test_a_phase_to_neutral_or_of_a_feeder_is_none(name):
    assert {one.kind for one in readings(name)} == {"phase"}
