"""The arm in motion with its power, as a part of a page: data for assets/arm.js, and three.js, compressed."""

from __future__ import annotations

import base64
import gzip
import json
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from acqd.arrays import Floats

ASSETS = Path(__file__).with_name("assets")
ON_DEMAND = ("arm.js", "arm.css", "three.min.js", "three.LICENSE")
"""What a page of a server offers to a view of an arm."""


@dataclass(frozen=True, slots=True)
class Layer:
    """A part of a power, stacked on those before."""

    name: str
    colour: str
    """#rrggbb."""
    joints: Floats
    """[T, axes + 1] W by joint; the last column is of no joint."""


@dataclass(frozen=True, slots=True)
class Motion:
    """A recording, or a part of one."""

    name: str
    t: Floats
    """[T] s, from the start of the recording."""
    q: Floats
    """[T, axes] rad or m."""
    measured: Floats
    """[T] W."""
    predicted: Sequence[Layer]
    """Add up to the predicted power."""
    residual: Sequence[Layer]
    """Add up to measured minus predicted power, before the model was repaired."""


@dataclass(frozen=True, slots=True)
class ArmView:
    """The arm, its power and the residual of some recordings on one slider."""

    kind: ClassVar[str] = "arm"
    frames: dict[str, Any]
    """See `acqd.robot.frames`."""
    motions: Sequence[Motion]
    caption: str

    def data(self) -> str:
        """JSON for arm.js, safe within a script element."""
        content = {"frames": self.frames, "motions": [_as_json(each) for each in self.motions]}
        return json.dumps(content, separators=(",", ":")).replace("<", "\\u003c")


def _as_json(motion: Motion) -> dict[str, Any]:
    return {
        "name": motion.name,
        "t": np.round(motion.t, 2).tolist(),
        "q": np.round(motion.q, 4).tolist(),
        "measured": np.round(motion.measured, 1).tolist(),
        "predicted": [_layer(each) for each in motion.predicted],
        "residual": [_layer(each) for each in motion.residual],
        "joints": {"predicted": _leading(motion.predicted), "residual": _leading(motion.residual)},
    }


def _layer(layer: Layer) -> dict[str, Any]:
    return {"name": layer.name, "colour": layer.colour, "W": np.round(layer.joints.sum(axis=1), 1).tolist()}


def _leading(layers: Sequence[Layer]) -> dict[str, Any]:
    """Per row and joint: the layer with most power there, and the power of all layers."""
    joints = np.array([each.joints[:, :-1] for each in layers])
    return {"layer": np.abs(joints).argmax(axis=0).tolist(), "W": np.round(joints.sum(axis=0), 1).tolist()}


@cache
def asset(name: str) -> str:
    """Text of a file beside the template."""
    return (ASSETS / name).read_text(encoding="utf-8")


def scripts() -> dict[str, str]:
    """Style and script of a page with such a view, and three.js, compressed."""
    return {"style": asset("arm.css"), "script": asset("arm.js"), "three": _packed()}


@cache
def _packed() -> str:
    """three.js as base64 of gzip: a third of its size, and the browser reads none of it before it is asked for."""
    return base64.b64encode(gzip.compress(asset("three.min.js").encode(), 9, mtime=0)).decode()
