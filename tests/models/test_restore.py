"""Bundles that cannot be opened as a model."""

import pytest

from acqd.errors import InputError
from acqd.models.bundle.bundle import save_bundle
from acqd.models.bundle.restore import open_model
from tests.builders import grey_bundle


@pytest.mark.parametrize(
    "name", ["chain_axis", "chain_rotation", "chain_tip", "chain_xyz", "usual_signals", "parameters"]
)
def test_arrays_of_a_wrong_shape_are_told(tmp_path, name):
    bundle = grey_bundle()
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
