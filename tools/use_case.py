"""The thesis' use case (chapter 9) on the virtual laboratory: an assembly measured, predicted, simulated, explained.

    python -m tools.use_case OUT [--limited 46 --all 30 --assemblies 24 --epochs 2000 --seed 1]

Trains on random motions, measures assemblies with effects that nobody declared, predicts their power from measured
angles and from the twin's, closes the loop, and writes OUT/report.html and OUT/report.json. All data are simulated.
What is there already is not done again.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray
from rich.console import Console
from scipy.interpolate import CubicSpline

from acqd.models.data import Stretch, load_data
from acqd.models.metrics import predictions
from acqd.models.predictor import Predictor
from acqd.models.restore import open_model
from acqd.report.page import Page
from acqd.robot.arm import Arm
from acqd.robot.description import load_description
from acqd.robot.kinematics import forward_kinematics
from acqd.robot.log import read_log
from tools.measured_robots import acqd

Floats = NDArray[np.float64]
_PEAK_S = 0.6
"""After the brakes have opened: the initial peak (thesis Figures 6.2 and 9.4)."""
_MOVING = 0.02  # rad/s


@dataclass(frozen=True, slots=True)
class Errors:
    """Of some executions."""

    mae: float
    rmse: float

    @classmethod
    def of(cls, errors: list[Floats], kept: list[NDArray[np.bool_]]) -> Errors:
        """Over the rows kept."""
        e = np.concatenate([off[rows] for off, rows in zip(errors, kept, strict=True)])
        return cls(float(np.abs(e).mean()), float(np.sqrt((e**2).mean())))


def without_peak(stretch: Stretch, step_s: float) -> NDArray[np.bool_]:
    """Rows outside of the time after the brakes opened."""
    rises = np.flatnonzero(np.diff(stretch.signals["brake"], prepend=0.0) > 0)
    rows = np.ones(len(stretch.P), dtype=bool)
    for row in rises:
        rows[max(row - 1, 0) : row + round(_PEAK_S / step_s)] = False
    return rows


def prepare(arguments: argparse.Namespace) -> None:
    """Campaigns, datasets, models, the loop."""
    out: Path = arguments.out
    seed = str(arguments.seed)
    if not (out / "ds0" / "manifest.json").exists():
        acqd(
            "lab", "campaign", "--out", f"{out}/training", "--limited", str(arguments.limited), "--all",
            str(arguments.all), "--seed", seed,
        )  # fmt: skip
        acqd("dataset", "build", "--power", f"{out}/training/power.sqlite", "--logs", f"{out}/training/logs",
             "--out", f"{out}/ds0", "--robot", "iiwa7_r800")  # fmt: skip
    if not (out / "ds1" / "manifest.json").exists():
        acqd(
            "lab", "campaign", "--out", f"{out}/assembly", "--profile", "use-case", "--assemblies",
            str(arguments.assemblies), "--seed", seed,
        )  # fmt: skip
        acqd("dataset", "build", "--power", f"{out}/assembly/power.sqlite", "--logs", f"{out}/assembly/logs",
             "--out", f"{out}/ds1", "--robot", "iiwa7_r800")  # fmt: skip
    for network in ("grey-box", "21x1dim"):
        if not (out / network / "bundle.json").exists():
            epochs = ("--epochs", str(arguments.epochs)) if network == "21x1dim" else ()
            acqd("train", f"{out}/ds0", "--network", network, "--out", f"{out}/{network}", *epochs)
    if not (out / "loop" / "report.json").exists():
        acqd("close-loop", f"{out}/ds1", "--model", f"{out}/grey-box", "--out", f"{out}/loop")


@dataclass(frozen=True, slots=True)
class Twin:
    """The twin's motion of one execution, at the rows of the measured one."""

    q: Floats
    """[T, axes] rad."""
    pace: float
    """The twin's time over the cell's: it was played so much faster."""


def twin_of(out: Path, stretch: Stretch, robot: str, step_s: float) -> Twin:
    """Both begin and end to move at the same rows: the twin's time is scaled to the cell's pace."""
    path = next((out / "assembly" / "twin").rglob(f"{stretch.recording}.csv"))
    log = read_log(path, load_description(robot))
    grid = np.arange(log.time[0], log.time[-1], step_s)
    q = np.column_stack([np.interp(grid, log.time, column) for column in log.q.T])
    (begin, end), (start, stop) = span_of(stretch.q, step_s), span_of(q, step_s)
    pace = (stop - start) / (end - begin)
    at = np.clip(start + (np.arange(len(stretch.P)) - begin) * pace, 0, len(q) - 1)
    angles = CubicSpline(np.arange(len(q)), q)(at)
    return Twin(np.asarray(angles), pace)


def span_of(q: Floats, step_s: float) -> tuple[int, int]:
    """First and last row that move."""
    moving = np.flatnonzero(np.abs(np.gradient(q, step_s, axis=0)).max(axis=1) > _MOVING)
    return int(moving[0]), int(moving[-1])


def evaluate(out: Path) -> tuple[dict[str, Any], list[tuple[Figure, str]]]:
    """Numbers and pictures."""
    data = load_data(out / "ds1")
    opened, closed = open_model(out / "loop" / "model")
    fitted = set(opened.about["provenance"].get("closed_fit_recordings", ()))
    held_out = [stretch for stretch in data.stretches if stretch.recording not in fitted] or data.stretches
    everything = [np.ones(len(stretch.P), dtype=bool) for stretch in held_out]
    calm = [without_peak(stretch, data.step_s) for stretch in held_out]
    found: dict[str, Any] = {"executions": len(held_out), "models": {}}
    models = {name: open_model(out / name)[1] for name in ("21x1dim", "grey-box")} | {"grey-box, loop closed": closed}
    twins = [twin_of(out, stretch, data.robot, data.step_s) for stretch in held_out]
    simulated: dict[str, list[Floats]] = {}
    for name, model in models.items():
        predicted = predictions(model, held_out)
        errors = [guess - stretch.P for guess, stretch in zip(predicted, held_out, strict=True)]
        simulated[name] = [of_twin(model, twin, stretch) for twin, stretch in zip(twins, held_out, strict=True)]
        apart = [guess - stretch.P[: len(guess)] for guess, stretch in zip(simulated[name], held_out, strict=True)]
        found["models"][name] = {
            "predicted": table_of(errors, everything, calm),
            "simulated": table_of(apart, everything, [rows[: len(e)] for rows, e in zip(calm, apart, strict=True)]),
        }
    report = json.loads((out / "loop" / "report.json").read_text())
    found["loop"] = {key: report[key] for key in ("verdict", "effects", "before", "after", "reference_rmse")}
    arm = Arm(load_description(data.robot))
    found["pace"] = float(np.median([twin.pace for twin in twins]))
    found["end_effector_m"] = float(
        np.median([distance(arm, t, s).mean() for t, s in zip(twins, held_out, strict=True)])
    )
    pictures = [
        (motion_picture(arm, twins[0], held_out[0], data.step_s),
         "Figure 9.3: measured and simulated angles, and where that puts the flange."),
        *((power_picture(held_out[0], predictions(models[name], held_out[:1])[0], simulated[name][0], data.step_s),
           f"Figure 9.4: power predicted by {name} from measured angles (top) and from the twin's (bottom).")
          for name in ("21x1dim", "grey-box, loop closed")),
        (peak_picture(held_out[0], models, data.step_s), "The initial peak, before and after closing the loop."),
    ]  # fmt: skip
    return found, pictures


def of_twin(model: Predictor, twin: Twin, stretch: Stretch) -> Floats:
    """[rows] W; signals are those of the cell: the twin knows when it opens brakes and grips."""
    known = stretch.signals | {"Vrms": np.full(len(stretch.P), 230.0)}
    signals = np.column_stack([np.zeros((len(stretch.P), 0)), *(known[name] for name in model.signals)])
    return model.sequence(twin.q, signals, stretch.start_s)


def table_of(errors: list[Floats], everything: list[Any], calm: list[Any]) -> dict[str, float]:
    """MAE and RMSE with and without the peak."""
    whole, rest = (
        Errors.of(errors, [rows[: len(e)] for rows, e in zip(everything, errors, strict=True)]),
        Errors.of(errors, calm),
    )
    return {"mae": whole.mae, "rmse": whole.rmse, "mae_without_peak": rest.mae, "rmse_without_peak": rest.rmse}


def distance(arm: Arm, twin: Twin, stretch: Stretch) -> Floats:
    """[rows] m between measured and simulated flange."""
    one, other = (flange(arm, q) for q in (stretch.q, twin.q))
    return np.asarray(np.linalg.norm(one - other, axis=1))


def flange(arm: Arm, q: Floats) -> Floats:
    """[T, 3] m."""
    return forward_kinematics(arm, q)[0]


def motion_picture(arm: Arm, twin: Twin, stretch: Stretch, step_s: float) -> Figure:
    """As Figure 9.3."""
    figure = Figure(figsize=(11, 9))
    axes = figure.subplots(stretch.q.shape[1], 2, sharex=True)
    t = step_s * np.arange(len(twin.q))
    for k in range(stretch.q.shape[1]):
        axes[k, 0].plot(t, np.degrees(stretch.q[:, k]), color="#1f5f8b", lw=1)
        axes[k, 0].plot(t, np.degrees(twin.q[:, k]), color="#b45309", lw=1)
        axes[k, 0].set_ylabel(f"q{k + 1} [deg]", fontsize=8)
    one, other = flange(arm, stretch.q), flange(arm, twin.q)
    for k, name in enumerate("xyz"):
        axes[k, 1].plot(t, one[:, k], color="#1f5f8b", lw=1, label="measured")
        axes[k, 1].plot(t, other[:, k], color="#b45309", lw=1, label="twin")
        axes[k, 1].set_ylabel(f"{name} [m]", fontsize=8)
    axes[0, 1].legend(fontsize=8)
    axes[3, 1].plot(t, 1000 * np.linalg.norm(one - other, axis=1), color="#444", lw=1)
    axes[3, 1].set_ylabel("apart [mm]", fontsize=8)
    for k in range(4, stretch.q.shape[1]):
        axes[k, 1].axis("off")
    axes[-1, 0].set_xlabel("time [s]")
    axes[3, 1].set_xlabel("time [s]")
    return figure


def power_picture(stretch: Stretch, predicted: Floats, simulated: Floats, step_s: float) -> Figure:
    """As Figure 9.4."""
    figure = Figure(figsize=(11, 6))
    axes = figure.subplots(2, 1, sharex=True)
    t = step_s * np.arange(len(stretch.P))
    for axis, guess, name in ((axes[0], predicted, "predicted"), (axes[1], simulated, "simulated")):
        axis.plot(t, stretch.P, color="#1f5f8b", lw=1, label="measured")
        axis.plot(t[: len(guess)], guess, color="#b45309", lw=1, label=name)
        axis.set_ylabel("P [W]")
        axis.legend(fontsize=8)
    axes[1].set_xlabel("time [s]")
    return figure


def peak_picture(stretch: Stretch, models: dict[str, Predictor], step_s: float) -> Figure:
    """Around the brakes' opening."""
    figure = Figure(figsize=(9, 4))
    axis = figure.subplots()
    middle = int(np.argmax(np.diff(stretch.signals["brake"], prepend=0.0) > 0))
    rows = slice(max(middle - 15, 0), middle + 40)
    t = step_s * (np.arange(len(stretch.P)) - middle)
    axis.plot(t[rows], stretch.P[rows], color="#1f5f8b", lw=2, label="measured")
    for name, color in (("21x1dim", "#9ca3af"), ("grey-box", "#15803d"), ("grey-box, loop closed", "#b45309")):
        axis.plot(t[rows], predictions(models[name], [stretch])[0][rows], color=color, lw=1.2, label=name)
    axis.set_xlabel("time since the brakes opened [s]")
    axis.set_ylabel("P [W]")
    axis.legend(fontsize=8)
    return figure


def main() -> None:
    """All of it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--limited", type=int, default=46)
    parser.add_argument("--all", type=int, default=30)
    parser.add_argument("--assemblies", type=int, default=24)
    parser.add_argument("--epochs", type=int, default=2000)
    parser.add_argument("--seed", type=int, default=1)
    arguments = parser.parse_args()
    arguments.out = arguments.out.resolve()
    arguments.out.mkdir(parents=True, exist_ok=True)
    prepare(arguments)
    found, pictures = evaluate(arguments.out)
    page = Page("Use case: an assembly (thesis chapter 9)", simulated=True)
    header = ["model", "angles", "MAE [W]", "RMSE [W]", "MAE without the peak", "RMSE without the peak"]
    rows = [
        [name, kind, *values[kind].values()]
        for name, values in found["models"].items()
        for kind in ("predicted", "simulated")
    ]
    page.text(
        f"{found['executions']} executions that no model and no effect was fitted on. "
        "Predicted: from the angles that the robot logged; simulated: from the twin's own motion."
    )
    page.table(header, rows)
    page.text(
        f"The flange of the twin is {1000 * found['end_effector_m']:.0f} mm from the measured one in the mean: "
        f"its time is scaled to the cell's pace ({found['pace']:.3f})."
    )
    effects = ", ".join(f"{e['id']} ({e['where']}, confidence {e['confidence']:.0%})" for e in found["loop"]["effects"])
    page.text(f"What the loop found: {effects or found['loop']['verdict']}.")
    for figure, caption in pictures:
        page.figure(figure, caption)
    page.write(arguments.out / "report.html")
    (arguments.out / "report.json").write_text(json.dumps(found, indent=1))
    console = Console(width=150)
    for row in rows:
        console.print(*(f"{cell:.2f}" if isinstance(cell, float) else f"{cell:22}" for cell in row), highlight=False)
    console.print(f"loop: {found['loop']['verdict']}: {effects}", highlight=False)


if __name__ == "__main__":
    main()
