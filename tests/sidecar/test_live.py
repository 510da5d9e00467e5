"""Live rows."""

import json

import numpy as np
import orjson
import pytest

from acqd.models.augmented import Augmented, Term
from acqd.models.bundle.restore import open_model
from acqd.models.effects import library
from acqd.models.predictor import Stream
from acqd.sidecar.live import Live
from tests.builders import STEP, grey
from tests.models.test_old_files import FOLDER
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
    for each in split:
        assert sum(each["causes"].values()) == pytest.approx(each["P_predicted"], abs=0.1)
        assert len(each["joints"]) == 6 and all(name in each["causes"] for name, _ in each["joints"])


def answers(live, q):
    rows = [{"time": BEGIN + STEP * row, "q": angles.tolist(), "brake": 1} for row, angles in enumerate(q)]
    said = [live.answer(orjson.dumps(row)) for row in rows]
    return [json.loads(each) for each in said if each is not None]


def repaired(which):
    """A model with one term of every effect of the library, or with a play, which remembers where it was."""
    if which == "play":
        term = Term("torque_with_hysteresis", "joint 2", {"joint": 2, "heaviest_Nm": 40.0}, (0, 1), np.ones(2) * 9, {})
        return Augmented(grey(), grey(), [term])
    model = open_model(FOLDER / "all-effects")[1]
    newer = [Term("mounting", "base, tilted", {}, (0,), np.ones(1), {}),
             Term("joint_zero", "joint 2", {}, (1,), np.full(1, 0.05), {})]  # fmt: skip
    every = {each.id: each for each in (*model.terms, *newer)}
    assert set(library()) == set(every)
    return Augmented(model.base, model.carrier, list(every.values()))


@pytest.mark.parametrize(("which", "rest"), [("library", 0), ("play", 15)])
def test_causes_add_up_to_the_prediction_whatever_effects_the_model_has(which, rest, monkeypatch):
    for kept in ("models.augmented._PAST", "sidecar.live._REMEMBERED"):
        monkeypatch.setattr(f"acqd.{kept}", 12)
    moved = motion(160, 5)[70:79]
    q = np.concatenate([moved, np.repeat(moved[-1:], rest, axis=0)])  # the rows in which the play moved are forgotten
    split = [each for each in answers(Live(repaired(which), "joints", "power"), q) if "causes" in each]
    assert len(split) >= 2
    for each in split:
        assert sum(each["causes"].values()) == pytest.approx(each["P_predicted"], abs=0.2)


def test_predictions_go_on_where_the_split_fails_and_the_split_where_time_goes_back(monkeypatch):
    live, q = Live(grey(), "joints", "power"), motion(160, 5)[70:80]
    assert sum("causes" in each for each in answers(live, q)) == 2
    assert "causes" in answers(live, q)[0]  # the sender's clock was set back
    monkeypatch.setattr("acqd.sidecar.live.latest_parts", lambda *_: 1 / 0)
    said = answers(live, q)
    assert len(said) == 9 and not any("causes" in each for each in said)


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
