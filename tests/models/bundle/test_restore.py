"""Bundles that cannot be opened as a model."""

import numpy as np
import pytest

from acqd.errors import InputError, UserError
from acqd.models.bundle.bundle import Bundle, save_bundle
from acqd.models.bundle.restore import open_model, restore
from acqd.models.normalisation import Normalisation
from tests.builders import grey_bundle
from tests.models.motions import STEP


@pytest.mark.parametrize(
    "name", ["chain_axis", "chain_rotation", "chain_tip", "chain_xyz", "usual_signals", "parameters"]
)
def test_arrays_of_a_wrong_shape_are_told(tmp_path, name):
    bundle = grey_bundle(parameters=[{"name": "sign_speed"}])
    bundle.arrays[name] = bundle.arrays[name][..., :-1]
    save_bundle(tmp_path / "b", bundle)
    with pytest.raises(InputError, match="does not hold what its kind of model needs"):
        open_model(tmp_path / "b")


def test_weights_and_steps_that_cannot_be_are_told(tmp_path):
    save_bundle(tmp_path / "b", grey_bundle(step_s=-1.0))
    with pytest.raises(InputError, match="a step of -1"):
        open_model(tmp_path / "b")
    save_bundle(tmp_path / "c", grey_bundle())
    weights = tmp_path / "c" / "weights.safetensors"
    damaged = bytearray(weights.read_bytes())
    damaged[-5] ^= 1  # still numbers
    weights.write_bytes(damaged)
    with pytest.raises(InputError, match="does not match the hash"):
        open_model(tmp_path / "c")


def test_a_network_with_other_learnables_is_refused():
    about = {
        "kind": "network",
        "axes": 7,
        "step_s": STEP,
        "architecture": {"name": "21x1dim"},
        "normalisation": Normalisation.thesis(7).as_json(),
    }
    with pytest.raises(UserError, match="1463"):
        restore(Bundle(about, {"theta": np.zeros(1462, np.float32)}))
    with pytest.raises(UserError, match="22x1dim"):
        restore(Bundle(about | {"architecture": {"name": "22x1dim"}}, {"theta": np.zeros(1463, np.float32)}))


def with_columns(folder, columns):
    bundle = grey_bundle()
    effect = {"id": "coulomb_friction", "where": "joint 1", "shape": {}, "coefficients": [0.1], "parameters": {}}
    bundle.metadata["effects"] = [effect | {"columns": columns}]
    save_bundle(folder, bundle)
    return folder


@pytest.mark.parametrize("columns", [[-1], [0.5], [True], ["0"], [0, -7], [0, 1], [10**6]])
def test_columns_that_c_would_write_outside_of_an_array_are_refused(tmp_path, columns):
    open_model(with_columns(tmp_path / "good", [0]))
    with pytest.raises(InputError, match=r"columns \[|numbers of coefficients|index 1000000"):
        open_model(with_columns(tmp_path / "bad", columns))
