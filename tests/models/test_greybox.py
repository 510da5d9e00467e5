"""The grey box: its fit, its terms, its hybrid."""

from functools import partial

import numpy as np
import pytest

from acqd.models.features import motion
from acqd.models.greybox.fit import fit_grey_box
from acqd.models.hybrid.model import Hybrid, Perceptron
from acqd.models.metrics import measure, predictions
from acqd.models.normalisation import Normalisation
from acqd.robot import load_description
from acqd.robot.arm import Arm
from acqd.robot.dynamics import inverse_dynamics
from tests.models.motions import STEP, dataset, iiwa_power, streamed


def test_the_grey_box_recovers_what_made_the_data(grey):
    data, fit = grey
    test = data.part("test")
    assert measure(predictions(fit.model, test), test).mae < 1.0
    viscous, coulomb = fit.model.group("viscous"), fit.model.group("coulomb")
    assert np.median(viscous) == pytest.approx(8.0, rel=0.1) and np.median(coulomb) == pytest.approx(6.0, rel=0.15)
    assert fit.model.group("standby")[0] == pytest.approx(150, abs=1.5)
    names = [name for name, _ in fit.model.layout.names()]
    half = 1.96 * np.sqrt(np.diag(fit.covariance))
    k = names.index("viscous.joint2")
    assert 0.01 < half[k] < 4
    unseen = names.index("m.link1")  # mass of the link that only turns about the vertical: no power tells of it
    assert half[unseen] > 0.2 * fit.model.values[unseen]


@pytest.mark.parametrize("speed", [0.006, 0.02])
def test_the_speed_within_which_friction_turns_is_estimated(speed):
    data = dataset(partial(iiwa_power, direction=lambda qd: np.tanh(qd / speed)))
    fit = fit_grey_box(load_description("iiwa7_r800"), data.part("train"), STEP, 1, lambda share: None)
    estimate, half = fit.model.group("sign_speed")[0], 1.96 * np.sqrt(fit.covariance[-1, -1])
    assert estimate == pytest.approx(speed, abs=half + 0.2 * speed) and half < 0.01
    torque = fit.model.direction(np.array([-speed, 0.0, speed]))
    assert torque == pytest.approx([-0.76, 0.0, 0.76], abs=0.12)


def test_the_terms_of_a_grey_box_add_up_and_stream(grey):
    data, fit = grey
    q = data.segments[0].q
    from acqd.models.features import padded

    none = np.zeros((len(q), 0))
    terms = fit.model.terms(padded(q, 1), none)
    assert np.allclose(sum(terms.values()), fit.model.sequence(q), atol=1e-9)
    assert np.abs(streamed(fit.model, q) - fit.model.sequence(q)).max() < 1e-6
    network = Perceptron(*(np.random.default_rng(1).normal(size=shape) for shape in ((12, 21), (12,), (12,))))
    hybrid = Hybrid(fit.model, network, Normalisation.fitted(data.segments, STEP))
    assert np.abs(streamed(hybrid, q) - hybrid.sequence(q)).max() < 1e-6


def test_torques_that_were_logged_fix_the_scale():
    description = load_description("iiwa7_r800")

    def torque(q):
        return 1.04 * inverse_dynamics(Arm(description), *motion(q, STEP))

    data = dataset(iiwa_power, tau=torque)
    fit = fit_grey_box(description, data.part("train"), STEP, 1, lambda share: None)
    assert fit.model.group("gain")[0] == pytest.approx(1.06, abs=0.01)
