"""The error that a model has without any effect: that of the reference, or the noise floor without a reference."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from acqd import student
from acqd.arrays import Floats
from acqd.discrepancy.recordings import Subject
from acqd.discrepancy.thresholds import THRESHOLDS
from acqd.models.segments import Segment
from acqd.residual.residuals import errors_of, rms


@dataclass(frozen=True, slots=True)
class UsualError:
    """What no effect can be asked to explain."""

    reference: tuple[float, ...]
    """W RMS per reference recording; empty without a reference."""
    lowest_W: float
    """RMS."""

    @classmethod
    def of(cls, subject: Subject, floor_W: float) -> UsualError:
        """Of the model that is asked about; `floor_W`: part of the power that no model of motion can predict."""
        if not subject.reference:
            return cls((), floor_W)
        errors = errors_of(subject.model, subject.reference)
        return cls(tuple(by_recording(subject.reference, errors)), rms(errors))

    @property
    def reference_rms(self) -> float | None:
        """RMS of the reference; None without one."""
        return self.lowest_W if self.reference else None

    def exceeded_by(self, segments: list[Segment], errors: list[Floats]) -> bool:
        """Whether errors [T] W of recordings are larger than those of other recordings of the reference would be.

        By the logarithms of the RMS of recordings (two samples, Student's t), whose spread in the reference has a
        prior that counts as a few recordings; by their median now, since one protective stop is no growth. True
        without a reference, where nothing can be said.
        """
        return not self.reference or grown(self.reference, by_recording(segments, errors))


def grown(before_W: Sequence[float], now_W: Sequence[float]) -> bool:
    """Whether errors, RMS of recordings, are larger than other unchanged ones would be: see `exceeded_by`."""
    before, now = np.log(before_W), np.log(now_W)
    weight = THRESHOLDS.few_sessions
    squares = float(((before - before.mean()) ** 2).sum())
    freedom = weight + len(before) - 1
    variance = (weight * THRESHOLDS.usual_growth**2 + squares) / freedom
    error = float(np.sqrt(variance * (1 / len(before) + 1 / len(now))))
    return bool(float(np.median(now)) - before.mean() > error * float(student.isf(THRESHOLDS.chance, freedom)))


def by_recording(segments: list[Segment], errors: list[Floats]) -> list[float]:
    """W RMS per recording."""
    names = sorted({segment.recording for segment in segments})
    pairs = list(zip(segments, errors, strict=True))
    return [rms([error for segment, error in pairs if segment.recording == name]) for name in names]
