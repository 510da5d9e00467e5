"""Effects that begin or go on within a session."""

import numpy as np

from acqd.lab.cell import build_cell
from acqd.lab.effects import parse_effect
from acqd.lab.settings import LabSettings
from acqd.motion.controller import Wait


def test_an_effect_goes_on_after_the_last_recording(tmp_path):
    from acqd.lab.session import Session

    settings = LabSettings(effects=[parse_effect("offset_shift:power_W=50,at=1.0")])
    cell = build_cell(settings)
    session = Session(cell, 0, settings.start_utc_ns, np.zeros(7), lambda batch: None)
    session.record([Wait(3.0)], 1, "still", tmp_path / "still.log")
    truth = session.finish()
    hidden = truth.power - truth.clean_power
    np.testing.assert_allclose(hidden[[5, 20, 40, 80, 120]], [0, 0, 50, 50, 50], atol=0.1)


def test_a_saturation_begins_within_a_recording(tmp_path):
    from acqd.lab.session import Session

    settings = LabSettings(effects=[parse_effect("meter_saturation:limit_A=0.5,at=2.0")])
    cell = build_cell(settings)
    session = Session(cell, 0, settings.start_utc_ns, np.zeros(7), lambda batch: None)
    session.record([Wait(4.0)], 1, "still", tmp_path / "still.log")
    truth = session.finish()
    error = truth.metered - truth.power
    assert np.abs(error[:48]).max() < 1 and error[55:95].max() < -20
