"""The motion that a model was trained on."""

import numpy as np

from acqd.models.bundle.envelope import Envelope
from tests.models.motions import STEP, dataset


def test_motion_beyond_training_is_flagged():
    data = dataset(lambda q, k: np.full(len(q), 100.0), count=8, rows=100)
    envelope = Envelope.from_json(Envelope.of(data.segments, STEP).as_json())
    assert not any(envelope.outside(s.q, STEP).any() for s in data.segments)
    far = data.segments[0].q.copy()
    far[50] += 3.0
    assert envelope.outside(far, STEP)[50] and not envelope.outside(far, STEP)[:45].any()
