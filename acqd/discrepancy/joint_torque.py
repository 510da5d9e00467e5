"""Logged joint torques against the described body: they separate mechanical from electrical causes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acqd.arrays import Floats
from acqd.discrepancy.recordings import Subject
from acqd.discrepancy.thresholds import THRESHOLDS
from acqd.models.greybox.model import GreyBox
from acqd.models.segments import Segment


@dataclass(frozen=True, slots=True)
class JointTorque:
    """Logged torque minus the torque of the described body."""

    rms: Floats
    """[axes] Nm, of the recordings in question."""
    offset: Floats
    """[axes] Nm mean; minus the mean in the reference, if there is one."""
    changed: list[int]
    """Joints (from 1) whose offset differs significantly from the reference."""

    def as_text(self) -> str:
        """A sentence for the report."""
        if self.changed:
            joints = ", ".join(f"joint {k} by {self.offset[k - 1]:+.2f} Nm" for k in self.changed)
            return f"logged torques have shifted against the reference: {joints} (a sensor's zero, or a load)"
        return "logged torques agree with the motion as well as they did: they show no mechanical change"


def joint_torque(subject: Subject) -> JointTorque | None:
    """None if torques were not logged."""
    now, before = _figures(subject.carrier, subject.fit), _figures(subject.carrier, subject.reference)
    if now is None:
        return None
    mean, rms = now
    offset = mean.mean(axis=0)
    changed: list[int] = []
    if before is not None and len(before[0]) > 2 and len(mean) > 2:
        offset = offset - before[0].mean(axis=0)
        error = np.sqrt(mean.var(axis=0) / len(mean) + before[0].var(axis=0) / len(before[0])) + 1e-9
        significant = np.abs(offset) > THRESHOLDS.torque_significance * error
        changed = [int(k) + 1 for k in np.flatnonzero(significant & (np.abs(offset) > THRESHOLDS.torque_least_Nm))]
    return JointTorque(np.sqrt((rms**2).mean(axis=0)), offset, changed)


def _figures(model: GreyBox, segments: list[Segment]) -> tuple[Floats, Floats] | None:
    """[segments, axes] mean and RMS, Nm; None without logged torques."""
    figures = []
    for segment in segments:
        if segment.tau is None:
            continue
        q, qd, qdd = segment.motion(model.step_s)
        residual = segment.tau - model.motor_torque(q, qd, qdd)[0]
        figures.append((residual.mean(axis=0), np.sqrt((residual**2).mean(axis=0))))
    if not figures:
        return None
    return np.array([mean for mean, _ in figures]), np.array([rms for _, rms in figures])
