"""The residual at the joints, where torques were logged: it separates mechanical causes from electrical ones."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acqd.arrays import Floats
from acqd.discrepancy.recordings import Subject
from acqd.models.features import motion
from acqd.models.greybox.model import GreyBox
from acqd.models.segments import Segment

_CHANGED = 6.0  # standard errors over recordings
_LEAST_NM = 0.3


@dataclass(frozen=True, slots=True)
class JointLevel:
    """Logged torque minus that of the described body."""

    rms: Floats
    """[axes] Nm, of the dataset."""
    offset: Floats
    """[axes] Nm, mean; against the reference where there is one."""
    changed: list[int]
    """Joints (from 1) whose offset differs from the reference by more than chance."""

    def as_text(self) -> str:
        """One sentence."""
        if self.changed:
            each = ", ".join(f"joint {k} by {self.offset[k - 1]:+.2f} Nm" for k in self.changed)
            return f"logged torques have shifted against the reference: {each} (a sensor's zero, or a load)"
        return "logged torques agree with the motion as well as they did: nothing mechanical shows there"


def joint_level(subject: Subject) -> JointLevel | None:
    """None where no torques were logged."""
    in_question, before = _means(subject.carrier, subject.fit), _means(subject.carrier, subject.reference)
    if in_question is None:
        return None
    mean, rms = in_question
    offset = mean.mean(axis=0)
    changed: list[int] = []
    if before is not None and len(before[0]) > 2 and len(mean) > 2:
        offset = offset - before[0].mean(axis=0)
        error = np.sqrt(mean.var(axis=0) / len(mean) + before[0].var(axis=0) / len(before[0])) + 1e-9
        significant = (np.abs(offset) > _CHANGED * error) & (np.abs(offset) > _LEAST_NM)
        changed = [int(k) + 1 for k in np.flatnonzero(significant)]
    return JointLevel(np.sqrt((rms**2).mean(axis=0)), offset, changed)


def _means(model: GreyBox, segments: list[Segment]) -> tuple[Floats, Floats] | None:
    """[recordings, axes] mean and RMS."""
    found = []
    for segment in segments:
        if segment.tau is None:
            continue
        q, qd, qdd = motion(segment.q, model.step_s)
        off = segment.tau - model.motor_torque(q, qd, qdd)[0]
        found.append((off.mean(axis=0), np.sqrt((off**2).mean(axis=0))))
    if not found:
        return None
    return np.array([mean for mean, _ in found]), np.array([rms for _, rms in found])
