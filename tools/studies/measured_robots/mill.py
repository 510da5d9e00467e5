"""Logs of two axes of a milling machine, out of the public recordings of a machine with worn and sharp tools.

    python -m tools.studies.measured_robots.mill OUT [--data ../shared/data/robots/cnc_mill]

The recordings hold mm, mm/s and kW at 10 Hz. Their positions have three digits, too few for an acceleration. The logs
hold m and W: integrated speeds, held to the recorded positions over 2 s, and the power of both drives. The Z drive was
not measured, and the spindle's power does not depend on the place of an axis.
"""

from __future__ import annotations

import argparse
import csv
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import cumulative_trapezoid
from scipy.ndimage import gaussian_filter1d

from acqd.cli.main import for_people

Floats = NDArray[np.float64]
DESCRIPTION = Path(__file__).with_name("mill.toml")
DATA = Path(__file__).parents[4] / "shared" / "data" / "robots" / "cnc_mill"
_EPOCH_S, _APART_S, _STEP_S = 1_700_000_000.0, 1000.0, 0.1  # the recordings have no date
_HELD_S = 2.0
_AXES = ("Y1", "X1")


def places(position: Floats, speed: Floats) -> Floats:
    """[T] of one axis, with the digits of the integrated speed and the level of the recorded position."""
    moved = cumulative_trapezoid(speed, dx=_STEP_S, initial=0.0)
    return np.asarray(moved + gaussian_filter1d(position - moved, _HELD_S / _STEP_S, mode="nearest"))


def write_logs(data: Path, out: Path) -> None:
    """One log per recording, in a folder that is called as the tool's condition: `unworn` or `worn`."""
    for number, path in enumerate(sorted(data.glob("experiment_*.csv"))):
        with path.open() as file:
            rows = list(csv.DictReader(file))
        folder = out / rows[0]["tool_condition"]
        folder.mkdir(parents=True, exist_ok=True)
        values = {key: np.array([float(row[key]) for row in rows]) for key in rows[0] if key[:2] in _AXES}
        time = _EPOCH_S + number * _APART_S + _STEP_S * np.arange(len(rows))
        q = [places(values[f"{axis}_ActualPosition"], values[f"{axis}_ActualVelocity"]) / 1000 for axis in _AXES]
        power = 1000 * (values["Y1_OutputPower"] + values["X1_OutputPower"])
        lines = [f"{t:.1f},{y:.8f},{x:.8f},{P:.4f}" for t, y, x, P in zip(time, *q, power, strict=True)]
        (folder / path.name).write_text("\n".join(["time,q1,q2,power", *lines, ""]))


def main() -> None:
    """Write the logs."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--data", type=Path, default=DATA)
    arguments = parser.parse_args()
    write_logs(arguments.data, arguments.out)
    print(f"{arguments.out}/unworn, {arguments.out}/worn; description: {DESCRIPTION}")


if __name__ == "__main__":
    for_people(main)
