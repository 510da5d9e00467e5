"""Datasets and bundles of an earlier version open, and predict what they predicted then."""

import numpy as np
import pytest

from acqd.models.bundle.reference import load_reference
from acqd.models.bundle.restore import open_model
from acqd.models.segments import load_dataset
from tests.places import ROOT

FOLDER = ROOT / "tests" / "data" / "before_rooms"


@pytest.fixture(scope="module")
def said():
    with np.load(FOLDER / "said.npz") as arrays:
        return dict(arrays)


def test_an_old_dataset_opens(said):
    dataset = load_dataset(FOLDER / "dataset")
    assert [segment.recording for segment in dataset.segments] == [f"r_2_{k:02d}" for k in range(4)]
    np.testing.assert_array_equal(dataset.segments[0].P, said["dataset_P"])
    np.testing.assert_array_equal(dataset.segments[0].q, said["dataset_q"])


@pytest.mark.parametrize("name", ["all-effects", "grey-box", "network"])
def test_an_old_bundle_predicts_what_it_predicted(name, said):
    segment = load_dataset(FOLDER / "dataset").segments[0]
    _, model = open_model(FOLDER / name)
    known = {**segment.channels, **segment.signals}
    none = np.zeros(len(segment.P))
    columns = [known.get(signal, none) for signal in model.signals]
    signals = np.column_stack([np.zeros((len(segment.P), 0)), *columns])
    predicted = model.sequence(segment.q, signals, segment.start_s)
    # networks are float32: another processor's vector instructions round otherwise
    tolerance = {"rtol": 1e-6} if name == "network" else {"rtol": 0, "atol": 1e-9}
    np.testing.assert_allclose(predicted, said[name], **tolerance)


def test_an_old_reference_is_remembered(said):
    remembered = load_reference(FOLDER / "all-effects")
    np.testing.assert_array_equal(np.concatenate([segment.P for segment in remembered]), said["remembered_P"])
