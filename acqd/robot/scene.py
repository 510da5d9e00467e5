"""Scenes: the boxes around a robot and the tool that it carries. One TOML file per scene."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from pydantic import Field, model_validator

from acqd.errors import UserError
from acqd.robot.description import Capsule, Section, read_toml
from acqd.robot.joint import Vector

_FOLDER = Path(__file__).parent / "scenes"


class Box(Section):
    """A solid box in the frame of the robot's base."""

    name: Annotated[str, Field(min_length=1)]
    centre: Vector
    """m."""
    size: Vector
    """Edge lengths [m]."""
    rpy_deg: Vector = (0.0, 0.0, 0.0)

    @model_validator(mode="after")
    def _solid(self) -> Box:
        if min(self.size) <= 0:
            raise ValueError(f"box {self.name!r}: size {self.size} needs three positive lengths")
        return self


class Tool(Section):
    """The tool on the flange, in the flange frame."""

    capsules: Annotated[list[Capsule], Field(min_length=1)]


class Scene(Section):
    """The surroundings of one robot."""

    name: str
    box: list[Box] = Field(default=[])
    tool: Tool | None = None
    margin_m: Annotated[float, Field(ge=0, le=0.5)] = 0.01
    """Distance that counts as a collision."""

    @model_validator(mode="after")
    def _names_differ(self) -> Scene:
        names = [box.name for box in self.box]
        if len(set(names)) < len(names):
            raise ValueError(f"box names {names} are not all different")
        return self


def load_scene(name: str) -> Scene:
    """A shipped scene by name, or one from a TOML file by path. Raises UserError or InputError."""
    path = Path(name) if name.endswith(".toml") or "/" in name else _FOLDER / f"{name}.toml"
    if path.parent == _FOLDER and not path.exists():
        known = ", ".join(sorted(shipped.stem for shipped in _FOLDER.glob("*.toml")))
        raise UserError(f"scene {name!r} is unknown; known: {known}, or a path to a .toml")
    return read_toml(path, Scene)
