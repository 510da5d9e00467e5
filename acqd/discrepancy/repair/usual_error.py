"""The error that a model has without any effect: that of the reference, or the noise floor without a reference."""

from __future__ import annotations

from dataclasses import dataclass

from acqd.arrays import Floats
from acqd.discrepancy.recordings import Subject
from acqd.discrepancy.residual.residuals import about_means, errors_of, rms


@dataclass(frozen=True, slots=True)
class UsualError:
    """What no effect can be asked to explain."""

    reference: list[Floats]
    """[T] W per reference segment; empty without a reference."""
    lowest_W: float
    """RMS."""
    varying_W: float
    """RMS about the mean of every minute."""

    @classmethod
    def of(cls, subject: Subject, floor_W: float) -> UsualError:
        """Of the model that is asked about; `floor_W`: part of the power that no model of motion can predict."""
        if not subject.reference:
            return cls([], floor_W, floor_W)
        errors = errors_of(subject.model, subject.reference)
        return cls(errors, rms(errors), rms(about_means(errors)))

    @property
    def reference_rms(self) -> float | None:
        """RMS of the reference; None without one."""
        return self.lowest_W if self.reference else None

    def exceeded_by(self, errors: list[Floats]) -> bool:
        """Whether errors [T] W are larger than those of the reference; True without one, where nothing can be said."""
        return not self.reference or rms(errors) > self.lowest_W
