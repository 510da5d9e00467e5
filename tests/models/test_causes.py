"""Parts of a model's power: they add up, and the stored energy of a closed motion is zero."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acqd.errors import UserError
from acqd.models.augmented import Augmented
from acqd.models.bundle.restore import open_model
from acqd.models.causes import parts_of
from acqd.models.effects import library
from acqd.models.effects.cause import Cause
from acqd.models.greybox.model import GreyBox
from acqd.models.hybrid.model import Hybrid, Perceptron
from acqd.models.metrics import predictions
from acqd.models.normalisation import Normalisation
from acqd.robot.arm import Arm
from acqd.robot.dynamics import gravity_torque
from tests.builders import AXES, ROBOT, STEP, grey, recording
from tests.models.test_old_files import FOLDER


@pytest.fixture(scope="module")
def everything():
    """A repaired model with every effect of the library at all of its places."""
    return open_model(FOLDER / "all-effects")[1]


def network(random):
    normal = Normalisation(*(np.ones((3, AXES)) * each for each in (0.0, 1.0)), 0.0, 1.0)
    W, b, out = random.normal(0, 1, (4, 3 * AXES)), random.normal(0, 1, 4), random.normal(0, 5, 4)
    return Perceptron(W, b, out), normal


@settings(max_examples=30, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    hybrid=st.booleans(),
    number_of_effects=st.integers(0, 4),
    piece=st.booleans(),
    logged=st.booleans(),
)
def test_parts_add_up_to_the_prediction(everything, seed, hybrid, number_of_effects, piece, logged):
    random = np.random.default_rng(seed)
    model = grey()
    values = model.values * random.uniform(0.0, 3.0, len(model.values))
    values[model.layout.part("gain")] = random.uniform(0.5, 1.5)
    base = GreyBox(model.chain, model.layout, values, STEP, np.ones(1))
    terms = [everything.terms[k] for k in random.integers(0, len(everything.terms), number_of_effects)]
    whole = Hybrid(base, *network(random)) if hybrid else base
    repaired = Augmented.of(whole, base, terms)
    segment = recording(base, 1, rows=90, seed=seed % 1000)
    if piece:
        segment = replace(segment, q=segment.q[40:], P=segment.P[40:], before=segment.q[30:40],
                          signals={k: v[40:] for k, v in segment.signals.items()},
                          channels={k: v[40:] for k, v in segment.channels.items()})  # fmt: skip
    if not logged:
        segment = replace(segment, signals={}, channels={})
    predicted = predictions(repaired, [segment])[0]
    parts = parts_of(repaired, segment)
    assert np.abs(sum(each.power for each in parts) - predicted).max() <= 1e-9 * max(1.0, np.abs(predicted).max())
    assert {each.term.id for each in parts if each.term} == {each.id for each in terms}


def test_parts_of_a_model_with_every_effect_add_up(everything):
    segment = recording(everything.carrier, 2, rows=200)
    predicted = predictions(everything, [segment])[0]
    parts = parts_of(everything, segment)
    assert np.abs(sum(each.power for each in parts) - predicted).max() <= 1e-9 * np.abs(predicted).max()
    assert {each.cause for each in parts if each.term} == {effect.cause for effect in library().values()}


def test_potential_and_kinetic_energy_of_a_closed_motion_are_zero():
    base = grey()
    segment = recording(base, 3, rows=700)  # begins and ends at rest
    there_and_back = np.concatenate([segment.q, segment.q[::-1]])
    brake = {"brake": np.ones(1400)}
    segment = replace(segment, q=there_and_back, P=np.zeros(1400), signals=brake, channels={})
    parts = {each.name: each for each in parts_of(base, segment)}
    moved = np.abs(parts["gravity"].joints).sum()
    assert abs(parts["gravity"].power.sum()) < 2e-3 * moved
    stored = parts["inertia"].power + parts["rotor"].power
    assert abs(stored.sum()) < 2e-3 * np.abs(parts["inertia"].joints + parts["rotor"].joints).sum()
    # A joint by itself does net work on the others through the arm: only the sum is an energy that is stored.
    assert np.abs(parts["gravity"].joints.sum(axis=0)).max() < 2e-2 * moved


def test_potential_energy_is_that_of_another_library():
    base = grey()
    base.values[base.layout.part("lag")] = 0.0
    segment = replace(recording(base, 3, rows=300), signals={"brake": np.ones(300)})
    power = next(each.power for each in parts_of(base, segment) if each.name == "gravity")
    speed = (segment.q[2:] - segment.q[:-2]) / (2 * STEP)
    expected = base.group("gain")[0] * (gravity_torque(Arm(ROBOT), segment.q)[1:-1] * speed).sum(axis=1)
    np.testing.assert_allclose(power[1:-1], expected, atol=1e-6)


def test_a_loss_is_never_negative_and_belongs_to_its_joint():
    base = grey()
    segment = recording(base, 4, rows=300)
    parts = {each.cause: each for each in parts_of(base, segment)}
    for cause in (Cause.DRY, Cause.VISCOUS, Cause.COPPER):
        assert parts[cause].joints.min() > -1.0  # the lag of the supply may ring by a few tenths of a watt
    assert not parts[Cause.STANDBY].joints[:, :-1].any() and not parts[Cause.COPPER].joints[:, -1].any()


def test_a_network_is_refused():
    segment = recording(grey(), 1, rows=60)
    with pytest.raises(UserError, match="has no physical parts"):
        parts_of(open_model(FOLDER / "network")[1], segment)
