"""Options of the laboratory's commands, and how they become settings."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, TypeVar

import typer
from pydantic import ValidationError

from acqd.errors import UserError
from acqd.robot.description import complaint, read_toml_table

Robot = Annotated[str | None, typer.Option(help="Shipped robot (default iiwa7_r800), or a description's path.")]
Scene = Annotated[str | None, typer.Option(help="Shipped scene (digital_factory, free), or a path.")]
Seed = Annotated[int | None, typer.Option(min=0, help="Same seed, same results (default 1).")]
LabFile = Annotated[Path | None, typer.Option("--settings", help="lab.toml with any of the settings.")]
Effects = Annotated[
    list[str] | None,
    typer.Option("--effect", metavar="ID[:NAME=VALUE,...]", help="Switch on an effect; see acqd lab effects."),
]
Undeclared = Annotated[
    list[str] | None,
    typer.Option("--undeclared", metavar="ID[:NAME=VALUE,...]", help="The same, kept out of the public manifest."),
]
Model = TypeVar("Model")


def settings_from(model: type[Model], file: Path | None, given: dict[str, Any], effects: list[Any]) -> Model:
    """Settings of a file, overruled by the options that were given. Raises UserError."""
    from acqd.lab.settings import CAMPAIGN_ONLY, LabSettings

    values = read_toml_table(file) if file else {}
    values |= {name: value for name, value in given.items() if value is not None}
    ordered = values.get("effects", [])
    if effects and isinstance(ordered, list):
        values["effects"] = [*ordered, *(effect.model_dump() for effect in effects)]
    if model is LabSettings:  # one file serves all commands
        values = {name: value for name, value in values.items() if name not in CAMPAIGN_ONLY}
    try:
        return model(**values)
    except ValidationError as error:
        where = f"{file}: " if file else ""
        raise UserError(where + "; ".join(complaint(fault) for fault in error.errors())) from None
