"""The assembly of thesis chapter 9: power predicted from measured angles and simulated from the twin's angles."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from acqd.models.bundle.restore import open_model
from acqd.models.metrics import predictions
from acqd.models.predictor import Predictor
from acqd.models.segments import Dataset, Segment, load_dataset
from acqd.residual.residuals import rms
from acqd.robot.arm import Arm
from acqd.robot.description import load_description
from acqd.robot.kinematics import forward_kinematics
from acqd.robot.log_reader import read_log

Floats = NDArray[np.float64]
_PEAK_S = 0.6
"""Duration of the initial peak after the brakes open, s (thesis Figures 6.2, 9.4)."""
_MOVING = 0.02  # rad/s
NETWORK, GREY_BOX, CLOSED = "21x1dim", "grey-box", "grey-box, loop closed"


@dataclass(frozen=True, slots=True)
class Places:
    """Folders of one reproduction."""

    out: Path

    @property
    def training(self) -> Path:
        """Dataset of the random motions."""
        return self.out / "ds0"

    @property
    def models(self) -> Path:
        """Folder of bundles."""
        return self.out / "models"

    @property
    def assembly(self) -> Path:
        """Campaign of the assembly."""
        return self.out / "assembly"

    @property
    def executions(self) -> Path:
        """Dataset of the assembly."""
        return self.out / "ds1"

    @property
    def loop(self) -> Path:
        """Results of `acqd close-loop`."""
        return self.out / "loop"

    def bundle(self, network: str) -> Path:
        """Bundle of a network that was trained on everything with seed 1."""
        return self.models / f"{network}-everything-s1"


@dataclass(frozen=True, slots=True)
class Twin:
    """Motion of the twin in one execution, resampled to the measured rows."""

    q: Floats
    """[T, axes] rad."""
    pace: float
    """Duration of the twin's motion over the duration of the measured motion."""


def twin_of(assembly: Path, segment: Segment, robot: str, step_s: float) -> Twin:
    """Read the twin's motion and scale its time, so that it moves in the same rows as the measured arm."""
    path = next((assembly / "twin").rglob(f"{segment.recording}.csv"))
    log = read_log(path, load_description(robot))
    grid = np.arange(log.time[0], log.time[-1], step_s)
    q = np.column_stack([np.interp(grid, log.time, column) for column in log.q.T])
    first, last = span_of(segment.q, step_s)
    twin_first, twin_last = span_of(q, step_s)
    pace = (twin_last - twin_first) / (last - first)
    rows = np.clip(twin_first + (np.arange(len(segment.P)) - first) * pace, 0, len(q) - 1)
    angles = CubicSpline(np.arange(len(q)), q)(rows)
    return Twin(np.asarray(angles), pace)


def span_of(q: Floats, step_s: float) -> tuple[int, int]:
    """First and last row with motion."""
    moving = np.flatnonzero(np.abs(np.gradient(q, step_s, axis=0)).max(axis=1) > _MOVING)
    return int(moving[0]), int(moving[-1])


def without_peak(segment: Segment, step_s: float) -> NDArray[np.bool_]:
    """[T], True for rows outside the initial peak."""
    rises = np.flatnonzero(np.diff(segment.signals["brake"], prepend=0.0) > 0)
    rows = np.ones(len(segment.P), dtype=bool)
    for row in rises:
        rows[max(row - 1, 0) : row + round(_PEAK_S / step_s)] = False
    return rows


@dataclass(frozen=True, slots=True)
class Case:
    """Held-out executions, and the models to be evaluated on them."""

    data: Dataset
    held_out: list[Segment]
    spared: bool
    """Whether no effect was fitted on them. With few executions the loop fits on all of them."""
    models: dict[str, Predictor]
    twins: list[Twin]
    arm: Arm

    @classmethod
    def of(cls, places: Places) -> Case:
        """Load models and executions. No model was trained on the executions."""
        data = load_dataset(places.executions)
        opened, closed = open_model(places.loop / "model")
        fitted = set(opened.metadata["provenance"].get("closed_fit_recordings", ()))
        spared = [segment for segment in data.segments if segment.recording not in fitted]
        held_out = spared or data.segments
        models = {name: open_model(places.bundle(name))[1] for name in (NETWORK, GREY_BOX)} | {CLOSED: closed}
        twins = [twin_of(places.assembly, segment, data.robot, data.step_s) for segment in held_out]
        return cls(data, held_out, bool(spared), models, twins, Arm(load_description(data.robot)))

    def simulated(self, name: str) -> list[Floats]:
        """Power [T] W from the twin's motion, by execution."""
        pairs = zip(self.twins, self.held_out, strict=True)
        return [of_twin(self.models[name], twin, segment) for twin, segment in pairs]

    def predicted(self, name: str) -> list[Floats]:
        """Power [T] W from measured angles, by execution."""
        return predictions(self.models[name], self.held_out)


def evaluate(case: Case, places: Places) -> dict[str, Any]:
    """Errors by model with and without the peak, distance of the twin, and the result of the loop."""
    results: dict[str, Any] = {"executions": len(case.held_out), "spared": case.spared, "models": {}}
    for name in case.models:
        results["models"][name] = {
            "predicted": errors_of(case.predicted(name), case.held_out, case.data.step_s),
            "simulated": errors_of(case.simulated(name), case.held_out, case.data.step_s),
        }
    report = json.loads((places.loop / "report.json").read_text())
    results["loop"] = {key: report[key] for key in ("verdict", "effects", "before", "after", "reference_rmse")}
    pairs = list(zip(case.twins, case.held_out, strict=True))
    results["pace"] = float(np.median([twin.pace for twin in case.twins]))
    results["end_effector_m"] = float(np.median([distance(case.arm, t, s).mean() for t, s in pairs]))
    differences = np.median([np.abs(t.q - s.q).mean(axis=0) for t, s in pairs], axis=0)
    results["axes_deg"] = np.degrees(differences).tolist()
    return results


def of_twin(model: Predictor, twin: Twin, segment: Segment) -> Floats:
    """Power [T] W from the twin's motion and the cell's signals: a twin knows its brake and gripper commands."""
    known = segment.signals | {"Vrms": np.full(len(segment.P), 230.0)}
    signals = np.column_stack([np.zeros((len(segment.P), 0)), *(known[name] for name in model.signals)])
    return model.sequence(twin.q, signals, segment.start_s)


def errors_of(powers: list[Floats], segments: list[Segment], step_s: float) -> dict[str, float]:
    """MAE and RMSE in W, with and without the peak (thesis Eq. 8.2, 8.3)."""
    pairs = list(zip(powers, segments, strict=True))
    errors = [power - segment.P[: len(power)] for power, segment in pairs]
    calm = np.concatenate([without_peak(segment, step_s)[: len(power)] for power, segment in pairs])
    e = np.concatenate(errors)
    return {
        "mae": float(np.abs(e).mean()), "rmse": rms([e]),
        "mae_without_peak": float(np.abs(e[calm]).mean()), "rmse_without_peak": rms([e[calm]]),
    }  # fmt: skip


def distance(arm: Arm, twin: Twin, segment: Segment) -> Floats:
    """Distance [T] m between measured and simulated flange."""
    measured, simulated = (flange(arm, q) for q in (segment.q, twin.q))
    return np.asarray(np.linalg.norm(measured - simulated, axis=1))


def flange(arm: Arm, q: Floats) -> Floats:
    """Flange positions [T, 3] m."""
    return forward_kinematics(arm, q)[0]
