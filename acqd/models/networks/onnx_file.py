"""Export of a bundle's network as an .onnx file."""

from __future__ import annotations

from pathlib import Path

from acqd import __version__
from acqd.atomic import require_earlier, write_complete
from acqd.errors import UserError
from acqd.models.bundle.bundle import Bundle
from acqd.models.networks.onnx_graph import PRODUCER, onnx_model
from acqd.models.networks.predictor import NetworkPredictor
from acqd.models.predictor import Predictor


def export_onnx(bundle: Bundle, model: Predictor, out: Path) -> int:
    """Write the file `out` completely or not at all. Returns its bytes. Raises UserError, OperationError."""
    if not isinstance(model, NetworkPredictor):
        raise UserError(
            f"{bundle.metadata['name']} is no network, and ONNX is for networks; acqd export-fmu exports every model"
        )
    if out.is_dir():
        raise UserError(f"{out} is a folder; name the file with --out")
    require_earlier(out, PRODUCER.encode(), "network of acqd export-onnx")
    metadata = bundle.metadata
    properties = {
        "acqd": __version__,
        "robot": str(metadata["robot"]),
        "network": str(metadata["name"]),
        "step_s": str(model.step_s),
        "look_ahead_rows": str(model.radius),
        "input": "q [T, axes] rad",
        "output": "P [T] W",
        "measured": str(metadata.get("measured", "")),
        "weights_sha256": str(metadata.get("weights_sha256", "")),
    }
    content: bytes = onnx_model(model, properties).SerializeToString()
    write_complete(out, content)
    return len(content)
