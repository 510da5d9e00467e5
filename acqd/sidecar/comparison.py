"""One log compared with the metered power: merged once, predicted once."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline

from acqd.arrays import Floats
from acqd.dataset.cut import CONTEXT_ROWS
from acqd.dataset.merge import Recording, merge
from acqd.dataset.power import PowerStream
from acqd.errors import UserError
from acqd.models.metrics import predictions
from acqd.models.predictor import Predictor
from acqd.models.segments import Segment, segments_of
from acqd.report.digits import percent
from acqd.sidecar.log_file import LogFile
from acqd.sidecar.residual import median_delay, residuals

_MIN_COVERED = 0.75  # of a log's time by power rows


@dataclass(frozen=True)
class Comparison:
    """Measured and predicted power of one log on common rows."""

    segments: list[Segment]
    predicted: list[Floats]
    """[T] W, one array for each segment."""
    lag_s: float
    """Controller minus power clock at which the prediction belongs to the rows."""
    covered: float
    """Share of the log's time that has rows."""
    step_s: float

    def at_lag(self, lag_s: float) -> Comparison:
        """The same rows of power with the prediction for another lag.

        Another lag moves the motion against the rows. Instead of merging and predicting again, the prediction is read
        off between its rows by a cubic spline; beyond the ends of a segment its first and last values are held. The
        spline's error grows with the shift, up to half a row.
        """
        shift = lag_s - self.lag_s
        if shift == 0.0:
            return self
        return replace(self, predicted=[_shifted(P, shift / self.step_s) for P in self.predicted], lag_s=lag_s)

    @cached_property
    def errors(self) -> list[Floats]:
        """[T] W measured minus predicted, one array for each segment."""
        return residuals(self.predicted, self.segments)

    def delay_s(self) -> float:
        """Seconds that measured power is later than predicted."""
        return median_delay(self.predicted, self.segments, self.step_s)


def compare(log: LogFile, power: PowerStream, lag_s: float, model: Predictor) -> Comparison:
    """Merges a log with its power at `lag_s` and predicts it. Raises UserError when too few power rows are there."""
    name = log.path.stem
    entry: dict[str, object] = {"name": name, "source": name, "kind": "other", "split": "test"}
    segments: list[Segment] = []
    predicted: list[Floats] = []
    for piece in log.pieces(CONTEXT_ROWS * model.step_s):
        recording = merge(name, piece, power, lag_s, 0.0, model.step_s)
        found = segments_of(_columns(recording), entry, model.step_s)
        segments += found
        predicted += predictions(model, found)
    start_s, end_s = log.span_s
    seconds = sum(len(segment.P) for segment in segments) * model.step_s
    covered = min(1.0, seconds / max(end_s - start_s, 1e-9))
    if covered < _MIN_COVERED:
        raise UserError(
            f"{log.path.name}: power rows are missing for {percent(1 - covered)} of the log; "
            "was the meter or the sink off?"
        )
    return Comparison(segments, predicted, lag_s, covered, model.step_s)


def _columns(recording: Recording) -> dict[str, Floats]:
    rows = {"time_ns": recording.time_ns, "valid": recording.valid}
    if recording.context is not None:
        rows["context"] = recording.context
    return {**rows, **recording.columns}  # type: ignore[dict-item]


def _shifted(values: Floats, rows: float) -> Floats:
    """Values [T] read off `rows` later, between the rows by a cubic spline."""
    index = np.arange(len(values), dtype=np.float64)
    return np.asarray(CubicSpline(index, values)(np.clip(index + rows, 0, len(values) - 1)))
