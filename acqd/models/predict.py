"""Predicted power of one robot log, with a flag on rows outside the range of the training data."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats
from acqd.atomic import require_earlier
from acqd.dataset.resample import resampled
from acqd.errors import InputError, UserError
from acqd.models.bundle.bundle import Bundle
from acqd.models.bundle.envelope import Envelope
from acqd.models.predictor import Predictor
from acqd.robot.description import load_description
from acqd.robot.log import RobotLog, in_time
from acqd.robot.log_ends import unknown_ends
from acqd.robot.log_reader import read_log

_COLUMNS = "time,P_predicted_W,outside_envelope"
_GAP_S = 0.25
_MIN_ROWS = 3


@dataclass(frozen=True, slots=True)
class Prediction:
    """Rows at the model's step."""

    time: Floats
    """[T] s, controller clock as logged."""
    P: Floats
    """[T] W; NaN where the log has a gap."""
    outside: NDArray[np.bool_]
    """[T], True for motion outside the envelope of the training data."""
    step_s: float
    note: str = ""
    """Rows of the log that were left out or estimated, and another robot than the model's; empty without either."""

    def energy(self) -> float:
        """Energy of all predicted rows in kWh."""
        return float(np.nansum(self.P)) * self.step_s / 3.6e6

    def write(self, path: Path) -> None:
        """Write the rows as CSV, in the place of an earlier prediction at most. Raises UserError."""
        require_earlier(path, _COLUMNS.encode(), "prediction")
        lines = [_COLUMNS]
        rows = zip(self.time, self.P, self.outside, strict=True)
        lines += [f"{t:.6f},{'' if np.isnan(p) else f'{p:.4f}'},{int(flag)}" for t, p, flag in rows]
        unfinished = path.with_name(f".{path.name}.new")
        try:
            if path.is_dir():
                raise IsADirectoryError(21, "is a folder")
            unfinished.write_text("\n".join([*lines, ""]), encoding="ascii")
            unfinished.replace(path)
        except OSError as error:
            unfinished.unlink(missing_ok=True)
            raise UserError(f"{path}: {error.strerror}; nothing was written, choose another --out") from None


def predict_log(bundle: Bundle, model: Predictor, path: Path, robot: str | None = None) -> Prediction:
    """Read a log and predict its power. `robot`: a description other than the bundle's.

    Raises InputError, UserError.
    """
    description = load_description(robot or bundle.metadata["description"])
    log = read_log(path, description)
    if log.q.shape[1] != model.axes:
        raise InputError(
            path, f"has {log.q.shape[1]} axes, the model {model.axes}: is it a log of {bundle.metadata['robot']}?"
        )
    prediction, trained = predict(bundle, model, log), bundle.metadata["robot"]
    if robot is None or description.name == trained:
        return prediction
    stranger = (
        f"read as a log of {description.name}, but the model is of {trained}: the power is what {trained} would draw; "
        "is that meant?"
    )
    return replace(prediction, note="; ".join([stranger, *filter(None, [prediction.note])]))


def predict(bundle: Bundle, model: Predictor, log: RobotLog) -> Prediction:
    """Resample the angles to the model's step and predict each segment without a gap.

    Raises InputError for a log that is too short or full of gaps, UserError for angles in degrees.
    """
    stamps, rows = in_time(log)
    step = model.step_s
    time = np.asarray(stamps - stamps[0])  # a double of seconds since 1970 resolves 0.2 us only
    grid = np.asarray(step * np.arange(int(time[-1] / step + 1e-6) + 1))
    if len(grid) < _MIN_ROWS:
        raise InputError(log.path, f"is {time[-1]:.2f} s long: too short to predict")
    q = np.column_stack([resampled(grid, time, log.q[rows, axis], step) for axis in range(model.axes)])
    signals = _signals(model, log, grid, time, rows)
    P = np.full(len(grid), np.nan)
    for first, end in _without_gaps(grid, time):
        P[first:end] = model.recording(q[first:end], None if signals is None else signals[first:end])
    if not np.isfinite(P).any():
        apart = float(np.median(np.diff(time)))
        unit = "; is time in ms? Write s" if 1 <= apart < 1_000 else ""
        raise InputError(
            log.path, f"rows are {apart:.3g} s apart; expected {_GAP_S} s at most, to predict between them{unit}"
        )
    outside = Envelope.from_json(bundle.metadata["envelope"]).outside(q, step)
    if outside.mean() > 0.5 and np.abs(q).max() > 2 * np.pi:
        raise UserError(f"{log.path}: angles reach {np.abs(q).max():.0f}: are they degrees? Expected radians")
    ends = int(unknown_ends(q, np.isfinite(P), step).sum())
    guessed = f"{ends} rows at ends in motion are estimated: their accelerations are not known" if ends else ""
    notes = [note for note in (log.note, *log.quality.sentences(), guessed) if note]
    return Prediction(stamps[0] + grid, P, outside, step, "; ".join(notes))


def _signals(model: Predictor, log: RobotLog, grid: Floats, time: Floats, rows: NDArray[np.int64]) -> Floats | None:
    if not model.signals or not all(name in log.signals for name in model.signals):
        return None
    columns = [resampled(grid, time, log.signals[name][rows], model.step_s) for name in model.signals]
    return np.where(np.isfinite(columns), columns, model.usual_signals()[:, None]).T


def _without_gaps(grid: Floats, time: Floats) -> list[tuple[int, int]]:
    """First grid point, and the one after the last, of each segment that the log covers."""
    breaks = np.flatnonzero(np.diff(time) > _GAP_S)
    starts, ends = np.concatenate([[time[0]], time[breaks + 1]]), np.concatenate([time[breaks], [time[-1]]])
    spans = zip(np.searchsorted(grid, starts - 1e-6), np.searchsorted(grid, ends + 1e-6), strict=True)
    return [(int(first), int(end)) for first, end in spans if end - first >= _MIN_ROWS]
