"""Campaigns whose true clock is known."""

import numpy as np
import pytest

from acqd.dataset.power import open_power
from tests.campaigns import clocked, clocked_dataset, true_lags


@pytest.fixture(
    scope="session",
    params=[
        "iiwa7_r800",
        pytest.param("ur10e", marks=pytest.mark.slow),
        pytest.param("kinova_gen3", marks=pytest.mark.minutes),
    ],
)
def campaign(request, once):
    """What was ordered, and the truth's lag of every recording."""
    made = clocked(request.param, once)
    return made, true_lags(made.settings, made.truth)


@pytest.fixture(scope="session")
def dataset(campaign, once):
    """The dataset of that campaign with every default, and the report of its making."""
    return clocked_dataset(campaign[0], once)


@pytest.fixture(scope="session")
def cell(once):
    """The campaign of the iiwa, the truth's lags, and its power as arrays."""
    made = clocked("iiwa7_r800", once)
    stream = open_power(str(made.out / "power.sqlite"), None, None)
    return made, true_lags(made.settings, made.truth), np.array(stream.time_ns), np.array(stream.P)
