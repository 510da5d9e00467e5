"""Predictions row by row and of whole sequences."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from acqd.models.networks.architecture import ARCHITECTURES, architecture
from acqd.models.networks.flat_parameters import initial
from acqd.models.networks.predictor import NetworkPredictor, example_inputs
from acqd.models.normalisation import Normalisation
from acqd.models.predictor import Stream
from tests.models.motions import STEP, streamed


@pytest.mark.xdist_group("torch")
@given(st.sampled_from(list(ARCHITECTURES)), st.integers(1, 70), st.sampled_from([3, 6, 7]), st.integers(0, 9))
def test_step_by_step_equals_the_whole_sequence(name, rows, axes, seed):
    import torch  # here: one worker imports it, for seconds

    from acqd.models.networks.torch_engine import TorchEngine

    chosen = architecture(name)
    normal = Normalisation.thesis(axes)
    theta = initial(chosen, axes, seed)
    model = NetworkPredictor(chosen, axes, STEP, theta, normal)
    q = np.random.default_rng(seed).normal(0, 1, (rows, axes))
    assert np.abs(streamed(model, q) - model.sequence(q)).max() < 1e-6
    with torch.no_grad():  # and both are what was trained
        engine = TorchEngine(chosen, axes)
        engine._load(theta)
        inputs = torch.from_numpy(example_inputs(chosen, normal, q, STEP)[None])
        trained = engine._network(inputs).numpy()[0] * normal.P_scale + normal.P_offset
    assert np.abs(model.sequence(q) - trained).max() < 1e-2


def test_a_stream_copies_what_it_is_given(grey):
    data, fit = grey
    q = data.segments[0].q[:50]
    stream, buffer, each = Stream(fit.model), np.empty(7), []
    for row in q:
        buffer[:] = row
        each.append(stream.step(buffer))
    each = [value for value in each if value is not None] + stream.finish()
    assert np.abs(each - fit.model.sequence(q)).max() < 1e-6
    assert Stream(fit.model).finish() == []
