"""Power for one robot log, with what lies outside of the model's experience flagged."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats
from acqd.dataset.resample import resampled
from acqd.errors import InputError, UserError
from acqd.models.bundle.bundle import Bundle
from acqd.models.bundle.envelope import Envelope
from acqd.models.predictor import Predictor
from acqd.robot.description import load_description
from acqd.robot.log import RobotLog, in_time, read_log

_GAP_S = 0.25
_LEAST_ROWS = 3


@dataclass(frozen=True, slots=True)
class Prediction:
    """Rows at the model's step; NaN where the log has a gap."""

    time: Floats
    """[T] s, controller clock as logged."""
    P: Floats
    """[T] W."""
    outside: NDArray[np.bool_]
    """[T]: motion beyond what the model was trained on."""
    step_s: float

    def energy(self) -> float:
        """kWh of all predicted rows."""
        return float(np.nansum(self.P)) * self.step_s / 3.6e6

    def write(self, path: Path) -> None:
        """As CSV. Raises UserError."""
        lines = ["time,P_predicted_W,outside_envelope"]
        rows = zip(self.time, self.P, self.outside, strict=True)
        lines += [f"{t:.6f},{'' if np.isnan(p) else f'{p:.4f}'},{int(flag)}" for t, p, flag in rows]
        beside = path.with_name(f".{path.name}.new")
        try:
            if path.is_dir():
                raise IsADirectoryError(21, "is a folder")
            beside.write_text("\n".join([*lines, ""]), encoding="ascii")
            beside.replace(path)
        except OSError as error:
            beside.unlink(missing_ok=True)
            raise UserError(f"{path}: {error.strerror}; nothing was written, choose another --out") from None


def predict_log(bundle: Bundle, model: Predictor, path: Path, robot: str | None = None) -> Prediction:
    """Read a log of the bundle's robot and predict. Raises InputError, UserError."""
    log = read_log(path, load_description(robot or bundle.metadata["description"]))
    if log.q.shape[1] != model.axes:
        raise InputError(
            path, f"has {log.q.shape[1]} axes, the model {model.axes}: is it of {bundle.metadata['robot']}?"
        )
    return predict(bundle, model, log)


def predict(bundle: Bundle, model: Predictor, log: RobotLog) -> Prediction:
    """Angles to the model's step, each stretch without a gap on its own. Raises InputError."""
    stamps, rows = in_time(log)
    step = model.step_s
    time = np.asarray(stamps - stamps[0])  # since 1970, a double resolves no better than 0.2 us
    grid = np.asarray(step * np.arange(int(time[-1] / step + 1e-6) + 1))
    if len(grid) < _LEAST_ROWS:
        raise InputError(log.path, f"is {time[-1]:.2f} s long: too short to predict")
    q = np.column_stack([resampled(grid, time, log.q[rows, axis], step) for axis in range(model.axes)])
    signals = _signals(model, log, grid, time, rows)
    P = np.full(len(grid), np.nan)
    for begin, end in _without_gaps(grid, time):
        P[begin:end] = model.sequence(q[begin:end], None if signals is None else signals[begin:end])
    if not np.isfinite(P).any():
        raise InputError(log.path, f"has no {_LEAST_ROWS} rows without a gap of {_GAP_S} s: nothing to predict")
    outside = Envelope.from_json(bundle.metadata["envelope"]).outside(q, step)
    if outside.mean() > 0.5 and np.abs(q).max() > 2 * np.pi:
        raise UserError(f"{log.path}: angles reach {np.abs(q).max():.0f}: are they degrees? Expected radians")
    return Prediction(stamps[0] + grid, P, outside, step)


def _signals(model: Predictor, log: RobotLog, grid: Floats, time: Floats, rows: NDArray[np.int64]) -> Floats | None:
    if not model.signals or not all(name in log.signals for name in model.signals):
        return None
    columns = [resampled(grid, time, log.signals[name][rows], model.step_s) for name in model.signals]
    return np.where(np.isfinite(columns), columns, model.usual_signals()[:, None]).T


def _without_gaps(grid: Floats, time: Floats) -> list[tuple[int, int]]:
    """First and one past the last grid point of each stretch that the log covers."""
    breaks = np.flatnonzero(np.diff(time) > _GAP_S)
    begins, ends = np.concatenate([[time[0]], time[breaks + 1]]), np.concatenate([time[breaks], [time[-1]]])
    spans = zip(np.searchsorted(grid, begins - 1e-6), np.searchsorted(grid, ends + 1e-6), strict=True)
    return [(int(begin), int(end)) for begin, end in spans if end - begin >= _LEAST_ROWS]
