"""A grey box that was fitted."""

import pytest

from acqd.models.greybox.fit import fit_grey_box
from acqd.robot import load_description
from tests.models.motions import STEP, dataset, iiwa_power


@pytest.fixture(scope="session")
def grey(once):
    """The data and the fit."""
    data = dataset(iiwa_power)
    robot = load_description("iiwa7_r800")
    return data, once("grey", lambda _: fit_grey_box(robot, data.part("train"), STEP, 1, lambda share: None))[1]
