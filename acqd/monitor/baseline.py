"""The baseline of a model's residual, from the recordings that its bundle remembers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from acqd.arrays import Floats
from acqd.errors import UserError
from acqd.models.bundle.reference import load_reference
from acqd.models.metrics import predictions
from acqd.models.predictor import Predictor
from acqd.models.segments import Segment
from acqd.monitor.blocks import blocks_of
from acqd.monitor.cusum import CHARTS, Baseline
from acqd.monitor.joint_chart import JointChart, grey_box_of
from acqd.monitor.score_charts import ScoreCharts
from acqd.residual.residuals import residuals, rms


@dataclass(frozen=True, slots=True)
class Remembered:
    """The recordings that a bundle remembers, and what the model says of them."""

    bundle: Path
    segments: list[Segment]
    predicted: list[Floats]
    """[T] W per segment."""
    errors: list[Floats]
    """[T] W per segment, measured minus predicted."""

    @classmethod
    def of(cls, bundle: Path, model: Predictor) -> Remembered:
        """Those of a bundle; none of a bundle without any. Raises InputError."""
        segments = load_reference(bundle)
        predicted = predictions(model, segments)
        return cls(bundle, segments, predicted, residuals(predicted, segments))


def baseline_of(bundle: Path, model: Predictor, between_s: float) -> Baseline:
    """Of all charts of the monitor, from the recordings that a bundle remembers. Raises UserError, InputError.

    `between_s`: mean recorded time between false alarms of all charts together, by Bonferroni's inequality.
    """
    remembered = Remembered.of(bundle, model)
    between_s *= len(CHARTS)
    baseline = baseline_from(remembered, model.step_s, between_s)
    in_time = sorted(range(len(remembered.segments)), key=lambda k: remembered.segments[k].start_s)
    segments = [remembered.segments[k] for k in in_time]
    errors, predicted = ([each[k] for k in in_time] for each in (remembered.errors, remembered.predicted))
    whitener, starts = baseline.whitener, [segment.start_s for segment in segments]
    blocks = [blocks_of(whitener, *each, model.step_s) for each in zip(errors, predicted, starts, strict=True)]
    grey_box = grey_box_of(model)
    return replace(
        baseline,
        joints=None if grey_box is None else JointChart.of(grey_box, segments, blocks, between_s),
        scores=ScoreCharts.of(whitener, segments, errors, predicted, blocks, between_s),
    )


def baseline_from(
    remembered: Remembered, step_s: float, between_s: float, kept: Callable[[Floats], Floats] = np.asarray
) -> Baseline:
    """For one false alarm in `between_s` recorded seconds. Raises UserError when the bundle remembers too little.

    The residual is smaller on recordings that the model was fitted on. There, it is scaled to the residual on the other
    recordings. `kept`: what is charted of the blocks' figures (see `Baseline.of`).
    """
    fitted = [segment.split == "train" for segment in remembered.segments]
    unseen = [residual for residual, own in zip(remembered.errors, fitted, strict=True) if not own]
    seen = [residual for residual, own in zip(remembered.errors, fitted, strict=True) if own]
    factor = max(1.0, rms(unseen) / max(rms(seen), 1e-9)) if seen and unseen else 1.0
    errors = [residual * (factor if own else 1.0) for residual, own in zip(remembered.errors, fitted, strict=True)]
    if errors:
        starts = [segment.start_s for segment in remembered.segments]
        baseline = Baseline.of(errors, remembered.predicted, starts, step_s, between_s, kept)
        if baseline is not None:
            return baseline
    raise UserError(
        f"{remembered.bundle} remembers too few recordings to distinguish a change from chance (at least two "
        "minutes); train it on a dataset with more, or close the loop on it once"
    )
