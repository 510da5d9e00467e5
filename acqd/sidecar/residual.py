"""Residual, delay and drift of a prediction; everything that the sidecar takes from acqd.discrepancy."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from acqd.arrays import Floats
from acqd.discrepancy.delay import delay_of
from acqd.errors import UserError
from acqd.models.predictor import Predictor
from acqd.models.segments import Segment
from acqd.monitor.baseline import baseline_of
from acqd.monitor.cusum import Monitor
from acqd.residual.residuals import residuals, rms

__all__ = ["DriftMonitor", "median_delay", "residuals", "rms"]

_LONGEST_DELAY_S = 0.1  # a longer one is not a lag of the clock


def median_delay(predicted: list[Floats], segments: list[Segment], step_s: float) -> float:
    """Seconds that measured power is later than predicted, median over the segments; 0 when none shows a delay.

    The model knows this robot better than any regression.
    """
    delays = [delay_of(P, segment.P, step_s) for P, segment in zip(predicted, segments, strict=True)]
    shown = [seconds for seconds, gain, _ in delays if gain > 0.0 and abs(seconds) < _LONGEST_DELAY_S]
    return float(np.median(shown)) if shown else 0.0


class DriftMonitor:
    """CUSUM monitor of the residual; watches nothing if the bundle remembers too few recordings."""

    def __init__(self, bundle: Path, model: Predictor, between_s: float) -> None:
        self.monitor: Monitor | None = None
        self.note: str | None = None
        """Why nothing is watched."""
        self._step_s = model.step_s
        try:
            self.monitor = Monitor(baseline_of(bundle, model, between_s))
        except UserError as error:
            self.note = f"no drift alarm: {error}"

    @property
    def state(self) -> str:
        """none, alarm or not watched."""
        if self.monitor is None:
            return "not watched"
        return "alarm" if self.monitor.alarm is not None else "none"

    def update(self, errors: list[Floats], predicted: list[Floats], segments: list[Segment]) -> dict[str, Any] | None:
        """Judges the residuals of one log; the alarm that they raise, if any."""
        alarm = None
        if self.monitor is not None:
            for error, P, segment in zip(errors, predicted, segments, strict=True):
                alarm = self.monitor.update(error, P, segment.start_s, self._step_s, segment) or alarm
        return None if alarm is None else alarm.as_json()

    def as_json(self) -> dict[str, Any] | None:
        """State for `restore`."""
        return None if self.monitor is None else self.monitor.as_json()

    def restore(self, state: dict[str, Any] | None) -> None:
        """Continues from the state of `as_json`. Raises KeyError, ValueError, TypeError."""
        if self.monitor is not None and state:
            self.monitor.restore(state)
