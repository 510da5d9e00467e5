"""Common options of the laboratory's commands, and their conversion to settings."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, TypeVar

import typer
from pydantic import ValidationError

from acqd.errors import UserError
from acqd.robot.description import complaint, read_toml_table

Robot = Annotated[str | None, typer.Option(help="Shipped robot (default iiwa7_r800), or path of a description.")]
Scene = Annotated[str | None, typer.Option(help="Shipped scene (digital_factory, free), or path of a scene.")]
Seed = Annotated[int | None, typer.Option(min=0, help="Random seed; the same seed gives the same results (default 1).")]
RobotSeed = Annotated[
    int | None,
    typer.Option(min=0, help="Seed of the true robot: the same robot in another session (default: --seed)."),
]
LabFile = Annotated[Path | None, typer.Option("--settings", help="Settings file; see config/lab.toml.")]
Effects = Annotated[
    list[str] | None,
    typer.Option("--effect", metavar="ID[:NAME=VALUE,...]", help="Switch on an effect; see acqd lab effects."),
]
Undeclared = Annotated[
    list[str] | None,
    typer.Option("--undeclared", metavar="ID[:NAME=VALUE,...]", help="Like --effect, but not in the public manifest."),
]
Model = TypeVar("Model")


def settings_from(model: type[Model], file: Path | None, given: dict[str, Any], effects: list[Any]) -> Model:
    """Settings from a file, overridden by the options in `given`; effects of both are combined. Raises UserError."""
    from acqd.lab.settings import CAMPAIGN_ONLY, LabSettings

    values = read_toml_table(file) if file else {}
    values |= {name: value for name, value in given.items() if value is not None}
    from_file = values.get("effects", [])
    if effects and isinstance(from_file, list):
        values["effects"] = [*from_file, *(effect.model_dump() for effect in effects)]
    if model is LabSettings:  # the same file serves all commands
        values = {name: value for name, value in values.items() if name not in CAMPAIGN_ONLY}
    try:
        return model(**values)
    except ValidationError as error:
        prefix = f"{file}: " if file else ""
        raise UserError(prefix + "; ".join(complaint(fault) for fault in error.errors())) from None
