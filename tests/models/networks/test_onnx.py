"""Networks as ONNX, computed by onnxruntime."""

import numpy as np
import pytest

pytest.importorskip("onnx", reason="onnx is not installed: pip install 'acqd[onnx]'")
pytest.importorskip("onnxruntime", reason="onnxruntime is not installed")

import onnxruntime as runtime

import acqd
from acqd.models.bundle.bundle import Bundle, save_bundle
from acqd.models.networks.architecture import ARCHITECTURES
from acqd.models.networks.flat_parameters import initial
from acqd.models.normalisation import Normalisation
from tests.builders import about, grey_bundle
from tests.commands import acqd_here, refused
from tests.models.motions import angles

AXES = 6


def network(folder, name):
    """A bundle of a network with initial weights."""
    metadata = about(
        "network", architecture={"name": name}, normalisation=Normalisation.thesis(AXES).as_json(), measured="simulated"
    )
    save_bundle(folder / name, Bundle(metadata, {"theta": 3.0 * initial(ARCHITECTURES[name], AXES, 1)}))
    return folder / name


@pytest.mark.parametrize("name", ARCHITECTURES)
def test_onnxruntime_computes_what_the_bundle_predicts(name, tmp_path):
    model = acqd.open_model(network(tmp_path, name))
    file = acqd.export_onnx(model, tmp_path / "n.onnx")
    session = runtime.InferenceSession(file, providers=["CPUExecutionProvider"])
    for rows in (1, 2, 700):
        q = angles(700, AXES, 3)[:rows]
        expected = model.predictor.sequence(q)  # an exported model takes the arm for resting at the ends
        (power,) = session.run(["P"], {"q": q})
        assert power.shape == expected.shape
        np.testing.assert_allclose(power, expected, rtol=0, atol=1e-6)
    assert np.ptp(expected) > 1.0
    assert session.get_modelmeta().custom_metadata_map["robot"] == "ur10e"


def test_the_command_exports_networks_only(tmp_path):
    done = acqd_here("export-onnx", network(tmp_path, "7x1dim"), "--json")
    assert done.returncode == 0 and (tmp_path / "7x1dim.onnx").exists(), done.stderr
    save_bundle(tmp_path / "grey", grey_bundle())
    assert "is no network" in refused(acqd_here("export-onnx", tmp_path / "grey"))
    assert not (tmp_path / "grey.onnx").exists()
