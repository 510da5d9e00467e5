"""Frequency responses in `[source] correction`: taken as they are, or refused in one line."""

from __future__ import annotations

import pytest
from pydantic import ValidationError

from acqd.daemon.correction_section import CorrectionSection
from acqd.errors import SettingError
from acqd.metering import StreamFormat
from acqd.metering.wiring_finding import WiringFinding

FORM = StreamFormat(20_000.0, (0.0225, 0.000281) * 3)
POINTS = [[50.0, 1.0, 0.0], [2_500.0, 0.9, -12.0]]


def test_a_response_is_of_the_spectrum_and_leaves_the_samples_alone():
    section = CorrectionSection.model_validate({"u_response": POINTS})
    voltages, currents = section.responses(FORM)
    assert currents is None and section.of(FORM) is None
    assert abs(voltages.at(2_500.0)) == pytest.approx(0.9) and abs(voltages.at(1_275.0)) == pytest.approx(0.95)
    assert abs(voltages.at(9_000.0)) == pytest.approx(0.9)
    reversed_ = WiringFinding("i1 is reversed", (1, 2, 3), (-1, 1, 1))
    assert str(POINTS) in section.after(reversed_) and "i_response" not in section.after(reversed_)


@pytest.mark.parametrize(
    ("points", "expected"),
    [
        ([[50.0, 1.0, 0.0]], "two or more points"),
        ([[50.0, 1.0], [100.0, 1.0]], "[Hz, ratio, degrees]"),
        ([[50.0, 1.0, 0.0], [50.0, 0.9, 0.0]], "rise from point to point"),
        ([[50.0, 1.0, 0.0], [100.0, 0.0, 0.0]], "0.01 to 100"),
        ([[50.0, 1.0, 0.0], [100.0, float("nan"), 0.0]], "finite"),
    ],
)
def test_a_response_that_is_none_is_refused(points, expected):
    with pytest.raises(ValidationError) as caught:
        CorrectionSection.model_validate({"i_response": points})
    assert expected in str(caught.value)


def test_an_error_at_the_nominal_frequency_belongs_into_gain_and_delay():
    section = CorrectionSection.model_validate({"i_response": [[10.0, 1.02, 0.0], [2_500.0, 1.02, 0.0]]})
    with pytest.raises(SettingError, match="i_gain and i_delay_us"):
        section.of(FORM)
