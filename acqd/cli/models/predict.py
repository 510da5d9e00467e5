"""`acqd predict`: power of a robot log."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import orjson
import typer

from acqd.cli.options import Json
from acqd.cli.terminal import terminal
from acqd.extras import require
from acqd.report.digits import percent, quantity


def predict(
    bundle: Annotated[Path, typer.Argument(metavar="BUNDLE", help="Folder that acqd train wrote.")],
    log: Annotated[Path, typer.Argument(metavar="LOG", help="Robot log: text, CSV, Parquet, or a ROS bag.")],
    out: Annotated[Path | None, typer.Option(help="CSV file for the predicted rows.")] = None,
    robot: Annotated[
        str | None, typer.Option(help="Robot description that maps the columns of the log (default the bundle's).")
    ] = None,
    json: Json = False,
) -> None:
    """Predict the power of a logged motion.

    Example: acqd predict ds.models/grey-box-everything-s1 campaign/logs/cell-01/all_01_0001.log --out power.csv
    """
    require("acqd predict", ("safetensors", "scipy"), "predict")
    from acqd.models.bundle.restore import open_model
    from acqd.models.predict import predict_log

    opened, model = open_model(bundle)
    prediction = predict_log(opened, model, log, robot)
    if out is not None:
        prediction.write(out)
    if prediction.note:
        terminal(stderr=True).print(f"acqd: {log}: {prediction.note}")
    share = float(prediction.outside.mean())
    if share > 0:
        terminal(stderr=True).print(
            f"acqd: {log}: {percent(share)} of the rows are outside the range of motion of the training data"
        )
    known = np.isfinite(prediction.P)
    summary = {
        "model": opened.metadata["name"],
        "robot": opened.metadata["robot"],
        "trained_on_power": opened.metadata["measured"],
        "rows": len(prediction.P),
        "gaps": int((~known).sum()),
        "mean_W": float(prediction.P[known].mean()),
        "max_W": float(prediction.P[known].max()),
        "energy_kWh": prediction.energy(),
        "outside_envelope": share,
        "left_out": prediction.note or None,
        "out": None if out is None else str(out),
    }
    if json:
        powers = [float(p) if finite else None for p, finite in zip(prediction.P, known, strict=True)]
        rows = {"time": prediction.time, "P_W": powers}
        print(orjson.dumps(summary | ({} if out else rows), option=orjson.OPT_SERIALIZE_NUMPY).decode())
        return
    print(
        f"{log}: {len(prediction.P) * prediction.step_s:.1f} s, "
        f"mean {summary['mean_W']:.2f} W, max {summary['max_W']:.2f} W, "
        f"{quantity(1000 * summary['energy_kWh'], 'Wh', 4)} by {summary['model']} "
        f"(trained on {summary['trained_on_power']} power)" + (f"; rows in {out}" if out else "")
    )
