"""`acqd export-onnx`: export a network for ONNX runtimes."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import orjson
import typer

from acqd.cli.options import Json
from acqd.extras import require


def export_onnx(
    bundle: Annotated[Path, typer.Argument(metavar="BUNDLE", help="Folder of a network that acqd train wrote.")],
    out: Annotated[Path | None, typer.Option(help="File to write (default BUNDLE.onnx).")] = None,
    json: Json = False,
) -> None:
    """Export a network as ONNX: joint angles q [T, axes] rad in, power P [T] W out.

    Example: acqd export-onnx ds.models/21x1dim-everything-s1 --out power.onnx
    """
    require("acqd export-onnx", ("onnx", "safetensors", "scipy"), "onnx")
    from acqd.models.bundle.restore import open_model
    from acqd.models.networks.onnx_file import export_onnx as export

    target = out or bundle.with_name(f"{bundle.resolve().name}.onnx")
    opened, model = open_model(bundle)
    size = export(opened, model, target)
    if json:
        print(orjson.dumps({"onnx": str(target), "bytes": size, "axes": model.axes, "step_s": model.step_s}).decode())
        return
    print(f"{target}: {size / 1000:.0f} kB, q [T, {model.axes}] rad, {model.step_s} s apart -> P [T] W")
