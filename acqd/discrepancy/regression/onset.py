"""When an effect may have started: all of the dataset, or from one of its recordings on."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acqd.arrays import Floats
from acqd.discrepancy.regression.design_columns import Part
from acqd.discrepancy.thresholds import THRESHOLDS


@dataclass(frozen=True, slots=True)
class Gate:
    """The blocks in which an effect acts."""

    label: str
    open: Floats
    """[blocks] 0 or 1."""
    start: str | None = None
    """First recording with the effect; None: all recordings of the dataset have it."""


def onset_gates(parts: list[Part]) -> list[Gate]:
    """All recordings in question, and from each of them on in the order of time; the first gate is the question."""
    times: dict[str, float] = {}
    for part in parts:
        if part.in_question:
            times[part.recording] = min(times.get(part.recording, np.inf), part.start_s)
    order = sorted(times, key=lambda name: times[name])
    in_question = np.array([part.in_question for part in parts]) * 1.0
    gates = [Gate("all of it", in_question)]
    fewest = THRESHOLDS.few_recordings
    for number in range(fewest, len(order) - fewest + 1):
        later = set(order[number:])
        gate = np.array([float(part.recording in later) for part in parts]) * in_question
        gates.append(Gate(f"from {order[number]} on", gate, order[number]))
    return gates
