"""Measured robots end to end: power rows and logs out of public recordings, then acqd's own commands on them.

    python -m tools.studies.measured_robots OUT [--data ../shared/data/robots] [--epochs N]

The UR3e's power is measured at its 48 V bus. That of the UR10e and the Kinova Gen3 is derived from motor currents:
P = P0 + sum(k i qd) + sum(R i^2), and its rows say so. Nothing here is simulated.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rich.table import Table

from acqd.cli.main import for_people
from acqd.models.greybox.fit import fit_grey_box
from acqd.models.metrics import predictions
from acqd.models.segments import load_dataset
from acqd.robot.description import RobotDescription, load_description
from acqd.robot.log import RobotLog
from acqd.robot.log_reader import read_log
from acqd.robot.table import read_table
from tools.common.commands import acqd as acqd  # re-exported: other studies import it from here
from tools.common.tables import show

Floats = NDArray[np.float64]
_EPOCH_S = 1_700_000_000.0  # the recordings have no date
_APART_S = 1000.0
_WINDOW_S = 0.04
_GAINS = {  # Nm at the joint per A, as the recordings' notes give them
    "ur10e": [10.0, 10.6956, 8.4566, 9.0029, 9.48, 10.1232],
    "kinova_gen3": [9.13, 9.13, 9.13, 9.13, 5.852, 5.852, 5.852],
}
_STANDBY_W = {"ur10e": 36.0, "kinova_gen3": 30.0}  # idle power; a constant, whatever it is


@dataclass(frozen=True)
class Robot:
    """A folder of recordings."""

    name: str
    folder: str
    cut_s: float


ROBOTS = (Robot("ur3e", "ur3e_rtde", 2.5), Robot("ur10e", "ur10e", 15.0), Robot("kinova_gen3", "kinova_gen3", 2.5))


def bus_power(path: Path) -> Floats:
    """[T] W of a UR's RTDE log, measured."""
    table = read_table(path)
    assert table.header is not None
    where = {name: k for k, name in enumerate(table.header)}
    return np.asarray(table.values[:, where["actual_robot_voltage"]] * table.values[:, where["actual_robot_current"]])


def derived_power(robot: RobotDescription, log: RobotLog) -> Floats:
    """[T] W from measured currents: mechanical power and copper loss."""
    assert log.current is not None and log.qd is not None
    resistance = np.array([joint.drive.resistance_Ohm for joint in robot.joint])
    mechanical = np.array(_GAINS[robot.name]) * log.current * log.qd
    return np.asarray(_STANDBY_W[robot.name] + (mechanical + resistance * log.current**2).sum(axis=1))


def prepare(robot: Robot, data: Path, out: Path) -> None:
    """power.csv and logs/ for `acqd dataset build`; each log at a time of its own."""
    write_inputs(robot.name, sorted((data / robot.folder).glob("*.csv")), out)


def write_inputs(name: str, paths: list[Path], out: Path, *, currents: bool = False, epoch_s: float = _EPOCH_S) -> None:
    """power.csv and logs/ of some recordings of a robot, the first one at `epoch_s`; the logs with motor currents."""
    description = load_description(name)
    (out / "logs").mkdir(parents=True)
    rows = ["time,P,flags"]
    for number, path in enumerate(paths):
        log = read_log(path, description)
        measured = name == "ur3e"
        P = bus_power(path) if measured else derived_power(description, log)
        order = np.argsort(log.time, kind="stable")
        t, P = log.time[order] - log.time.min() + epoch_s + number * _APART_S, P[order]
        begins = np.arange(t[0], t[-1] - _WINDOW_S, _WINDOW_S)
        if np.median(np.diff(t)) > 0.6 * _WINDOW_S:  # as sampled: each sample is the middle of its window
            begins, P_rows = t - _WINDOW_S / 2, P
        else:
            which = np.searchsorted(begins, t, side="right") - 1
            inside = which < len(begins)
            counts = np.bincount(which[inside], minlength=len(begins))
            sums = np.bincount(which[inside], P[inside], minlength=len(begins))
            begins, P_rows = begins[counts > 0], sums[counts > 0] / counts[counts > 0]
        flags = "" if measured else "derived"
        rows += [f"{begin:.6f},{power:.6f},{flags}" for begin, power in zip(begins, P_rows, strict=True)]
        columns = {"q": log.q[order]}
        if currents and log.current is not None:
            columns["current"] = log.current[order]
        names = ",".join(["time", *(f"{key}{k + 1}" for key in columns for k in range(description.axes))])
        values = np.column_stack(list(columns.values()))
        lines = [f"{when:.6f}," + ",".join(f"{x:.7f}" for x in row) for when, row in zip(t, values, strict=True)]
        (out / "logs" / path.name).write_text("\n".join([names, *lines, ""]))
    (out / "power.csv").write_text("\n".join([*rows, ""]))


def cross_validated(dataset: Path, folds: int = 5) -> tuple[float, float, int]:
    """R2 and MAE (W) of the grey box over all pieces, each predicted by a fit that has not seen it; their number."""
    data = load_dataset(dataset)
    robot = load_description(data.description)
    found: list[tuple[Floats, Floats]] = []
    for fold in range(folds):
        seen = [each for k, each in enumerate(data.segments) if k % folds != fold]
        held_out = [each for k, each in enumerate(data.segments) if k % folds == fold]
        model = fit_grey_box(robot, seen, data.step_s, 1, lambda _: None).model
        found += [(each.P, guess) for each, guess in zip(held_out, predictions(model, held_out), strict=True)]
    P, guess = (np.concatenate(parts) for parts in zip(*found, strict=True))
    return (
        float(1 - ((P - guess) ** 2).sum() / ((P - P.mean()) ** 2).sum()),
        float(np.abs(P - guess).mean()),
        len(found),
    )


def main() -> None:
    """All three robots, one table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("out", type=Path)
    parser.add_argument("--data", type=Path, default=Path(__file__).parents[4] / "shared" / "data" / "robots")
    parser.add_argument("--epochs", default="600")
    parser.add_argument("--seed", default="1", help="of the split")
    arguments = parser.parse_args()
    table = Table("robot", "power", "model", "held-out pieces", "R2", "MAE [W]", "95 %", "RMSE [W]", "energy p95")
    for robot in ROBOTS:
        out = arguments.out / robot.name
        prepare(robot, arguments.data, out)
        ds = str(out / "ds")
        acqd(
            "dataset",
            "build",
            "--power",
            f"{out}/power.csv",
            "--logs",
            f"{out}/logs",
            "--robot",
            robot.name,
            "--lag",
            "0",
            "--cut",
            str(robot.cut_s),
            "--seed",
            arguments.seed,
            "--out",
            ds,
        )
        acqd("train", ds, "--network", "grey-box")
        acqd("train", ds, "--network", "hybrid")
        acqd("train", ds, "--network", "21x1dim", "--epochs", arguments.epochs)
        found = json.loads(acqd("compare", ds, "--json"))
        for model in found["models"] + found["baselines"]:
            m = model["test"]["everything"]
            low, high = model["mae_ci95"]
            table.add_row(
                robot.name,
                "48 V bus" if found["measured"] == "mains" else found["measured"],
                model["name"],
                str(m["recordings"]),
                f"{m['r2']:.3f}",
                f"{m['mae']:.2f}",
                f"{low:.2f} to {high:.2f}",
                f"{m['rmse']:.2f}",
                f"{100 * m['energy_p95']:.1f} %",
            )
        r2, mae, pieces = cross_validated(out / "ds")
        power = "48 V bus" if found["measured"] == "mains" else found["measured"]
        table.add_row(robot.name, power, "grey-box, 5 folds", str(pieces), f"{r2:.3f}", f"{mae:.2f}", "", "", "")
        table.add_section()
    show(table, width=130)


if __name__ == "__main__":
    for_people(main)
