"""The thresholds that decide a verdict, by stage. Those of the noise model are in `acqd.residual.thresholds`."""

from __future__ import annotations

from dataclasses import dataclass

from acqd.discrepancy.thresholds.base import BaseThresholds
from acqd.discrepancy.thresholds.delay import DelayThresholds
from acqd.discrepancy.thresholds.detectors import DetectorThresholds
from acqd.discrepancy.thresholds.joints import JointThresholds
from acqd.discrepancy.thresholds.recordings import RecordingThresholds
from acqd.discrepancy.thresholds.selection import SelectionThresholds
from acqd.discrepancy.thresholds.uncertainty import UncertaintyThresholds
from acqd.discrepancy.thresholds.verdict import VerdictThresholds
from acqd.residual.thresholds import NOISE

__all__ = ["OF_THE_LOOP", "THRESHOLDS", "Thresholds"]


@dataclass(frozen=True)
class Thresholds(
    JointThresholds,
    VerdictThresholds,
    UncertaintyThresholds,
    SelectionThresholds,
    DetectorThresholds,
    BaseThresholds,
    DelayThresholds,
    RecordingThresholds,
):
    """The thresholds of the loop by stage; the last base has the first fields."""


THRESHOLDS = Thresholds()
"""The values in use."""
OF_THE_LOOP = (THRESHOLDS, NOISE)
"""All that the loop decides by, for `acqd.threshold.described`."""
