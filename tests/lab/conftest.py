"""A cell with its robot, trajectories drawn in it, and a small campaign."""

import numpy as np
import pytest

from acqd.lab.cell import build_cell
from acqd.lab.effects import parse_effect
from acqd.lab.settings import LabSettings
from acqd.motion.excitation import Cube
from tests.campaigns import campaign_config, measure

SMALL = {"limited": 3, "all_space": 2, "session": 2, "limited_sources": 2, "all_space_sources": 2}


@pytest.fixture(scope="module")
def cell():
    return build_cell(LabSettings())


@pytest.fixture(scope="module")
def drawn(cell):
    excitation = cell.excitation()
    limited = [excitation.limited_space(f"l{k}", Cube(), np.random.default_rng(k)) for k in range(3)]
    return limited, [excitation.all_space(f"a{k}", np.random.default_rng(k)) for k in range(3)]


@pytest.fixture(scope="session")
def campaign_settings():
    """Three sessions with one effect that is hidden and one that is declared."""
    hidden = parse_effect("payload:mass_kg=3,from=4", declared=False)
    declared = parse_effect("offset_shift:power_W=2")
    return {**SMALL, "effects": [hidden, declared], "clock": {"offset_s": -7.0, "drift_ppm": 50.0}}


@pytest.fixture(scope="session")
def campaign(campaign_settings, once):
    """What was ordered and reported; to look at, not to write into."""
    folder, report = once("lab", lambda folder: measure(campaign_config(folder, **campaign_settings)))
    return campaign_config(folder, **campaign_settings), report
