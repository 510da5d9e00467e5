"""Live rows."""

import json

import numpy as np
import orjson
import pytest

from acqd.models.predictor import Stream
from acqd.sidecar.live import Live
from tests.builders import STEP, grey
from tests.sidecar.cell import BEGIN, motion


def test_five_times_a_second_the_prediction_has_its_causes():
    model = grey()
    live, q = Live(model, "joints", "power"), motion(120, 5)
    said = [
        live.answer(orjson.dumps({"time": BEGIN + STEP * row, "q": angles.tolist()})) for row, angles in enumerate(q)
    ]
    messages = [json.loads(each) for each in said if each is not None]
    split = [each for each in messages if "causes" in each]
    assert len(messages) / 6 < len(split) <= len(messages) / 4
    for each in split[10:]:  # the first ones do not know the lag of the supply
        assert sum(each["causes"].values()) == pytest.approx(each["P_predicted"], abs=0.1)
        assert len(each["joints"]) == 6 and all(name in each["causes"] for name, _ in each["joints"])


def test_live_rows_are_predicted_as_the_model_says_and_bad_ones_counted():
    model = grey()
    live = Live(model, "joints", "power")
    q = motion(200, 5)
    stream = Stream(model)
    for row, angles in enumerate(q):
        answer = live.answer(orjson.dumps({"time": BEGIN + STEP * row, "q": angles.tolist(), "brake": 1}))
        wanted = stream.step(angles, np.ones(1))
        assert (answer is None) == (wanted is None)
        if answer is not None:
            assert json.loads(answer)["P_predicted"] == pytest.approx(wanted)
    for bad in (b"{", b'{"time": 1}', b'{"time": 1, "q": [1, 2]}', b'{"time": 1, "q": "x"}'):
        assert live.answer(bad) is None
    assert live.refused == 4
    assert live.answer(orjson.dumps({"time": BEGIN + STEP * 200, "q": [1e300] * 6, "brake": 1})) is None
    assert live.answer(orjson.dumps({"time": BEGIN + STEP * 201, "q": [0.0] * 6, "brake": 1})) is None
    assert live.refused == 5  # no number came of it, and the model must not remember it
    after_a_gap = live.answer(orjson.dumps({"time": BEGIN + 1000.0, "q": q[0].tolist()}))
    assert after_a_gap is None  # begins anew
