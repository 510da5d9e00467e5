"""A grey box that was fitted."""

import pytest

from acqd.models.greybox.fit import fit_grey_box
from acqd.robot import load_description
from tests.models.motions import STEP, dataset, iiwa_power


@pytest.fixture(scope="module")
def grey():
    data = dataset(iiwa_power)
    return data, fit_grey_box(load_description("iiwa7_r800"), data.part("train"), STEP, 1, lambda share: None)
