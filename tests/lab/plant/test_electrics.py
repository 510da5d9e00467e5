"""The storage of the DC link."""

import numpy as np
import pytest

from acqd.lab.plant.electrics import DcStorage
from acqd.lab.plant.parameters import DcLink


def test_what_comes_back_is_stored_up_to_the_limit_and_then_burnt():
    storage = DcStorage(DcLink(electronics_W=0, capacitor_J=5.0))
    net = np.concatenate([np.full(100, 20.0), np.full(300, -50.0), np.full(300, 30.0)])
    drawn, burnt, stored = storage.run(net)
    np.testing.assert_allclose(drawn, net + burnt + stored, atol=1e-12)
    assert (drawn >= -1e-9).all()
    assert burnt.sum() / 1000 == pytest.approx(0.3 * 50 - 5.0, abs=0.06)
    assert storage.energy == 0.0
    assert drawn[400:560].max() == pytest.approx(0.0, abs=1e-9)  # the capacitor feeds the drives first
