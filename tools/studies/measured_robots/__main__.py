"""Measured robots end to end: power rows and logs from public recordings, then the commands of acqd on them.

    python -m tools.studies.measured_robots OUT [--data ../shared/data/robots] [--epochs N]

The power of the UR3e was measured at its 48 V bus. The power of the UR10e and the Kinova Gen3 is derived from motor
currents, P = P0 + sum(k i qd) + sum(R i^2), and flagged so in every row. Nothing is simulated.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from acqd.models.greybox.fit import fit_grey_box
from acqd.models.metrics import predictions
from acqd.models.segments import load_dataset
from acqd.robot.description import RobotDescription, load_description
from acqd.robot.log import RobotLog, read_log
from acqd.robot.table import read_table

Floats = NDArray[np.float64]
_EPOCH_S = 1_700_000_000.0  # the recordings have no date
_APART_S = 1000.0
_WINDOW_S = 0.04
_GAINS = {  # Nm at the joint per A, from the notes of the recordings
    "ur10e": [10.0, 10.6956, 8.4566, 9.0029, 9.48, 10.1232],
    "kinova_gen3": [9.13, 9.13, 9.13, 9.13, 5.852, 5.852, 5.852],
}
_STANDBY_W = {"ur10e": 36.0, "kinova_gen3": 30.0}  # assumed: a constant does not affect the order of the models


@dataclass(frozen=True)
class Robot:
    """Recordings of one robot."""

    name: str
    folder: str
    cut_s: float
    """Length of the pieces that the recordings are cut into."""


ROBOTS = (Robot("ur3e", "ur3e_rtde", 2.5), Robot("ur10e", "ur10e", 15.0), Robot("kinova_gen3", "kinova_gen3", 2.5))


def bus_power(path: Path) -> Floats:
    """Measured bus power [T] W of an RTDE log."""
    table = read_table(path)
    assert table.header is not None
    where = {name: k for k, name in enumerate(table.header)}
    return np.asarray(table.values[:, where["actual_robot_voltage"]] * table.values[:, where["actual_robot_current"]])


def derived_power(robot: RobotDescription, log: RobotLog) -> Floats:
    """Power [T] W from measured currents: idle power, mechanical power and copper loss."""
    assert log.current is not None and log.qd is not None
    resistance = np.array([joint.drive.resistance_Ohm for joint in robot.joint])
    mechanical = np.array(_GAINS[robot.name]) * log.current * log.qd
    return np.asarray(_STANDBY_W[robot.name] + (mechanical + resistance * log.current**2).sum(axis=1))


def prepare(robot: Robot, data: Path, out: Path) -> None:
    """Write power.csv and logs/ for `acqd dataset build`. Each log gets another time of day."""
    description = load_description(robot.name)
    (out / "logs").mkdir(parents=True)
    rows = ["time,P,flags"]
    for number, path in enumerate(sorted((data / robot.folder).glob("*.csv"))):
        log = read_log(path, description)
        measured = robot.name == "ur3e"
        P = bus_power(path) if measured else derived_power(description, log)
        t = log.time - log.time[0] + _EPOCH_S + number * _APART_S
        flags = "" if measured else "derived"
        rows += [f"{start:.6f},{power:.6f},{flags}" for start, power in zip(*windows(t, P), strict=True)]
        names = ",".join(["time", *(f"q{k + 1}" for k in range(description.axes))])
        lines = [f"{when:.6f}," + ",".join(f"{x:.7f}" for x in q) for when, q in zip(t, log.q, strict=True)]
        (out / "logs" / path.name).write_text("\n".join([names, *lines, ""]))
    (out / "power.csv").write_text("\n".join([*rows, ""]))


def windows(t: Floats, P: Floats) -> tuple[Floats, Floats]:
    """Start [s] and mean power [W] of every window that contains a sample."""
    if np.median(np.diff(t)) > 0.6 * _WINDOW_S:  # one sample per window, in its middle
        return t - _WINDOW_S / 2, P
    starts = np.arange(t[0], t[-1] - _WINDOW_S, _WINDOW_S)
    which = np.searchsorted(starts, t, side="right") - 1
    inside = which < len(starts)
    counts = np.bincount(which[inside], minlength=len(starts))
    sums = np.bincount(which[inside], P[inside], minlength=len(starts))
    return starts[counts > 0], sums[counts > 0] / counts[counts > 0]


def acqd(*arguments: str) -> str:
    """Run a command and return its output."""
    done = subprocess.run([sys.executable, "-m", "acqd", *arguments], capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(f"acqd {' '.join(arguments)}: {done.stderr.strip()}")
    return done.stdout


def cross_validated(dataset: Path, folds: int = 5) -> tuple[float, float, int]:
    """R2, MAE in W and number of pieces, each predicted by a grey box that was fitted without it."""
    data = load_dataset(dataset)
    robot = load_description(data.description)
    pairs: list[tuple[Floats, Floats]] = []
    for fold in range(folds):
        training = [segment for k, segment in enumerate(data.segments) if k % folds != fold]
        held_out = [segment for k, segment in enumerate(data.segments) if k % folds == fold]
        model = fit_grey_box(robot, training, data.step_s, 1, lambda _: None).model
        pairs += [(s.P, predicted) for s, predicted in zip(held_out, predictions(model, held_out), strict=True)]
    P, predicted = (np.concatenate(parts) for parts in zip(*pairs, strict=True))
    r2 = float(1 - ((P - predicted) ** 2).sum() / ((P - P.mean()) ** 2).sum())
    return r2, float(np.abs(P - predicted).mean()), len(pairs)


def main() -> None:
    """Train and compare models for all three robots, and print one table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--data", type=Path, default=Path(__file__).parents[4] / "shared" / "data" / "robots")
    parser.add_argument("--epochs", default="600")
    parser.add_argument("--seed", default="1", help="seed of the split")
    arguments = parser.parse_args()
    table = Table("robot", "power", "model", "held-out pieces", "R2", "MAE [W]", "95 %", "RMSE [W]", "energy p95")
    for robot in ROBOTS:
        out = arguments.out / robot.name
        prepare(robot, arguments.data, out)
        ds = str(out / "ds")
        source = ("--power", f"{out}/power.csv", "--logs", f"{out}/logs", "--robot", robot.name, "--lag", "0")
        acqd("dataset", "build", *source, "--cut", str(robot.cut_s), "--seed", arguments.seed, "--out", ds)
        acqd("train", ds, "--network", "grey-box")
        acqd("train", ds, "--network", "hybrid")
        acqd("train", ds, "--network", "21x1dim", "--epochs", arguments.epochs)
        comparison = json.loads(acqd("compare", ds, "--json"))
        power = "48 V bus" if comparison["measured"] == "mains" else comparison["measured"]
        for model in comparison["models"] + comparison["baselines"]:
            m = model["test"]["everything"]
            low, high = model["mae_ci95"]
            errors = (f"{m['r2']:.3f}", f"{m['mae']:.2f}", f"{low:.2f} to {high:.2f}", f"{m['rmse']:.2f}")
            energy = f"{100 * m['energy_p95']:.1f} %"
            table.add_row(robot.name, power, model["name"], str(m["recordings"]), *errors, energy)
        r2, mae, pieces = cross_validated(out / "ds")
        table.add_row(robot.name, power, "grey-box, 5 folds", str(pieces), f"{r2:.3f}", f"{mae:.2f}", "", "", "")
        table.add_section()
    Console(width=130).print(table)


if __name__ == "__main__":
    main()
