"""Logs and tables of robots, and a bundle that predicts from them."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import orjson

from acqd.arrays import Floats
from tools.studies.fuzz.mutate import Files

_BEGIN = 1_700_000_000.0


def _motion(rows: int = 60) -> Floats:
    """[rows, 7]: time [s] and six angles [rad]."""
    t = np.arange(rows) * 0.04
    return np.column_stack([_BEGIN + t, 0.3 * np.sin(t[:, None] * np.arange(1, 7))])


def _motion_text(separator: str, names: list[str]) -> bytes:
    lines = [separator.join(f"{value:.4f}" for value in row) for row in _motion().tolist()]
    return "\n".join([separator.join(names), *lines, ""]).encode()


def logs() -> list[Files]:
    """Generic headers with several separators."""
    names = ["time", *(f"q{k}" for k in range(1, 7))]
    return [{"robot.log": _motion_text(separator, names)} for separator in ",; "]


def tables() -> list[Files]:
    """With a header, without, with decimal commas."""
    without = b"\n".join(b" ".join(b"%.3f" % value for value in row) for row in _motion(20).tolist())
    commas = logs()[1]["robot.log"].replace(b".", b",")
    return [{"robot.csv": logs()[0]["robot.log"]}, {"robot.csv": without}, {"robot.csv": commas}]


@cache
def grey_box() -> Any:
    """A grey box of a UR10e."""
    from acqd.models.greybox.model import GreyBox
    from acqd.models.greybox.parameters import Layout, prior
    from acqd.robot import load_description
    from acqd.robot.arm import Arm
    from acqd.robot.dynamics import inertial_parameters
    from acqd.robot.newton_euler import Chain

    robot = load_description("ur10e")
    layout = Layout(robot.axes, ("brake",))
    values = prior(layout, robot, inertial_parameters(Arm(robot)), 120.0, 0.04).mean.copy()
    values[layout.part("coulomb")], values[layout.part("lag")] = 5.0, 0.012
    return GreyBox(Chain.of(robot), layout, values, 0.04, np.ones(1))


@cache
def _bundle() -> tuple[bytes, bytes]:
    from safetensors.numpy import save

    from acqd.models.greybox.bundle_io import arrays_of

    angles = {"low": [-1.0] * 6, "high": [1.0] * 6}
    metadata = {
        "format": 1, "kind": "grey_box", "name": "trial", "robot": "UR10e", "description": "ur10e", "axes": 6,
        "step_s": 0.04, "inputs": [], "signals": ["brake"],
        "envelope": dict.fromkeys(("q_rad", "qd_rad_s", "qdd_rad_s2"), angles),
        "effects": [], "provenance": {"fit_recordings": [], "validation_recordings": [], "manifest_sha256": ""},
    }  # fmt: skip
    arrays = {name: np.ascontiguousarray(array) for name, array in arrays_of(grey_box()).items()}
    return orjson.dumps(metadata, option=orjson.OPT_INDENT_2), save(arrays)


def bundles() -> list[Files]:
    """A grey box. Its bundle.json names no hash: with one, every mutation of the weights would be refused by it."""
    metadata, weights = _bundle()
    return [{"bundle.json": metadata, "weights.safetensors": weights}]
