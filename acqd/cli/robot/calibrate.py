"""`acqd robot calibrate`: the scale of a model's torques from a known mass."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import orjson
import typer
from rich.console import Console

from acqd.cli.options import Json
from acqd.cli.terminal import terminal
from acqd.errors import UserError
from acqd.extras import require


def calibrate(
    dataset: Annotated[Path, typer.Argument(metavar="DS", help="Dataset with the known mass at the flange.")],
    known_mass: Annotated[float, typer.Option("--known-mass", metavar="KG", help="Mass at the flange.")],
    model: Annotated[
        Path | None,
        typer.Option(
            metavar="BUNDLE",
            help="Model of recordings without the mass (default the only bundle in DS.models, for a mass that is "
            "there while the tool is on).",
        ),
    ] = None,
    centre: Annotated[
        float | None,
        typer.Option(
            metavar="M",
            help="How far beyond the flange the centre of the mass is; needed where the flange is beside the last axis "
            "(a pendulum), because gravity shows mass times lever.",
        ),
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Bundle with the scale (default BUNDLE-calibrated).")] = None,
    json: Json = False,
) -> None:
    """Measure the scale of a model's torques, so that masses and frictions of close-loop are true ones.

    Power alone fixes only torque times gain. Where the drives are guessed, one move with a known mass tells the rest.

    Example: acqd robot calibrate with_1kg --known-mass 1.0 --model empty.models/grey-box-everything-s1
    """
    require("acqd robot calibrate", ("scipy",), "loop")
    from acqd.discrepancy.calibrate import calibrate as measure
    from acqd.discrepancy.config import CloseConfig

    bundle = model or _only_bundle(dataset)
    target = out or bundle.with_name(f"{bundle.name}-calibrated")
    config = CloseConfig(dataset=dataset, bundle=bundle, out=target)
    with Console(stderr=True).status("comparing with the model"):
        result = measure(config, known_mass, lambda _what, _share: None, centre)
    for note in result.notes:
        terminal(stderr=True).print(f"acqd: {note}")
    said = result.as_json()
    if json:
        print(orjson.dumps(said).decode())
        return
    low, high = said["torque_scale"]["ci95"]
    console = terminal()
    console.print(f"the model sees {result.model_kg:.3g} kg at the {result.where} for {known_mass:g} kg")
    console.print(f"its torques are {result.scale.value:.3g} ({low:.3g} to {high:.3g}, 95 %) times the true ones")
    console.print(f"{target}: the model with this scale; next: acqd close-loop DS --model {target}")


def _only_bundle(dataset: Path) -> Path:
    """The bundle beside the dataset. Raises UserError unless there is one."""
    folder = dataset.with_name(f"{dataset.name}.models")
    bundles = sorted(file.parent for file in folder.glob("*/bundle.json"))
    if len(bundles) != 1:
        raise UserError(
            f"{folder} holds {len(bundles)} models: name the one that learned without the mass with --model"
        )
    return bundles[0]
