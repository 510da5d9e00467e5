"""The screen of one robot: has the residual of its model changed since the training? A p-value, and since when."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from acqd.discrepancy.recordings import trained_recordings
from acqd.errors import UserError
from acqd.models.bundle.bundle import Bundle
from acqd.models.metrics import predictions
from acqd.models.predictor import Predictor
from acqd.models.segments import Dataset, Segment, load_dataset
from acqd.monitor.baseline import Remembered, baseline_from
from acqd.monitor.excursion import largest_excursion, without_level
from acqd.residual.residuals import residuals, rms

BETWEEN_S = 200 * 3600.0
"""Recorded seconds per false alarm of the watch. The p-value does not depend on it: bounds grow with its logarithm."""


@dataclass(frozen=True, slots=True)
class Screened:
    """What the screen says of one robot."""

    p: float
    chart: str
    height: float
    onset_s: float
    """UTC."""
    trained_s: float
    """UTC of the last row that the bundle remembers from before `first_s`; `first_s` if all recordings are later."""
    first_s: float
    """UTC of the start of the first recording in question."""
    first_end_s: float
    """UTC of its end."""
    last_s: float
    """UTC of the end of the last one."""
    recordings: int
    seconds: float
    """Recorded time in question."""
    rmse: float
    """W, of the recordings in question since the onset."""
    reference_rmse: float
    """W, of the recordings that the bundle remembers."""
    measured: str
    content: str
    """Hash of the recordings in question."""

    def as_json(self) -> dict[str, Any]:
        """For the robot's file."""
        return asdict(self)


def screen(model_path: Path, bundle: Bundle, model: Predictor, dataset: Path) -> Screened:
    """Judge the recordings that the model has not seen. Raises UserError, InputError."""
    data = load_dataset(dataset)
    _require_same_robot(dataset, bundle, model, data)
    remembered = Remembered.of(model_path, model)
    baseline = baseline_from(remembered, model.step_s, BETWEEN_S, without_level)
    seen = trained_recordings(bundle.metadata["provenance"], data)
    segments = sorted((s for s in data.segments if s.content not in seen), key=lambda each: each.start_s)
    if not segments:
        raise UserError(f"{dataset}: the model was fitted on all of its recordings; nothing is in question")
    predicted = predictions(model, segments)
    errors = residuals(predicted, segments)
    starts = [segment.start_s for segment in segments]
    range_W = float(np.ptp(np.percentile(np.concatenate([segment.P for segment in remembered.segments]), [1, 99])))
    rows = list(zip(errors, predicted, starts, strict=True))
    found = largest_excursion(baseline, BETWEEN_S, range_W, rows, data.step_s)
    if found is None:
        raise UserError(f"{dataset}: no recording is as long as a block of the charts (10 s); record longer ones")
    since = [e for e, s in zip(errors, segments, strict=True) if _end(s, data.step_s) > found.onset_s]
    return Screened(
        p=found.p, chart=found.chart, height=found.height, onset_s=found.onset_s,
        trained_s=_end_before(starts[0], remembered.segments, data.step_s), first_s=starts[0],
        first_end_s=max(_end(s, data.step_s) for s in segments if s.recording == segments[0].recording),
        last_s=max(_end(segment, data.step_s) for segment in segments),
        recordings=len({segment.recording for segment in segments}),
        seconds=sum(len(segment.P) for segment in segments) * data.step_s, rmse=rms(since),
        reference_rmse=rms(remembered.errors), measured=data.measured,
        content=data.content,
    )  # fmt: skip


def _end_before(time_s: float, segments: list[Segment], step_s: float) -> float:
    """UTC of the last end of segments before a time; that time where none ends before."""
    return max((end for end in (_end(each, step_s) for each in segments) if end <= time_s), default=time_s)


def _end(segment: Segment, step_s: float) -> float:
    return segment.start_s + len(segment.P) * step_s


def _require_same_robot(dataset: Path, bundle: Bundle, model: Predictor, data: Dataset) -> None:
    if data.axes != model.axes or abs(data.step_s - model.step_s) > 1e-9:
        raise UserError(
            f"{dataset} has {data.axes} axes and rows of {data.step_s} s, the model {model.axes} "
            f"({bundle.metadata['robot']}) and {model.step_s} s; use a model of this robot"
        )
