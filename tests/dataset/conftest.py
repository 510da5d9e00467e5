"""Campaigns whose true clock is known."""

import numpy as np
import pytest

from acqd.dataset.power import open_power
from tests.campaigns import build_dataset, campaign_config, measure, true_lags

CASES = {
    "iiwa7_r800": {"clock": {"offset_s": 30.0, "drift_ppm": 50.0}, "seed": 11},
    "ur10e": {"clock": {"offset_s": -29.0, "drift_ppm": -50.0}, "seed": 12, "mains": {"shape": "rectifier"}},
    "kinova_gen3": {"clock": {"offset_s": 7.3, "drift_ppm": 20.0}, "seed": 13},
}
SMALL = {"limited": 4, "all_space": 4}


def clocked(robot, once):
    """What was ordered."""
    settings = {"robot": robot, "session": 4, "recorder": {"missing": 0.05}, **SMALL, **CASES[robot]}
    folder, _ = once(f"clocked-{robot}", lambda folder: measure(campaign_config(folder, **settings)))
    return campaign_config(folder, **settings)


@pytest.fixture(scope="session", params=["iiwa7_r800", "ur10e", pytest.param("kinova_gen3", marks=pytest.mark.slow)])
def campaign(request, once):
    """What was ordered, and the truth's lag of every recording."""
    made = clocked(request.param, once)
    return made, true_lags(made.settings, made.truth)


@pytest.fixture(scope="session")
def dataset(campaign, once):
    """The dataset of that campaign with every default, and the report of its making."""
    made, _ = campaign
    folder, report = once(f"clocked-{made.settings.robot}-dataset", lambda folder: build_dataset(made, folder / "ds"))
    return folder / "ds", report


@pytest.fixture(scope="session")
def cell(once):
    """The campaign of the iiwa, the truth's lags, and its power as arrays."""
    made = clocked("iiwa7_r800", once)
    stream = open_power(str(made.out / "power.sqlite"), None, None)
    return made, true_lags(made.settings, made.truth), np.array(stream.time_ns), np.array(stream.P)
