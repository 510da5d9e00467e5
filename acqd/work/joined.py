"""Pieces of one log, which `dataset build` cuts for a split, as one recording again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from acqd.dataset.split import log_name
from acqd.models.segments import Segment

_GAP_ROWS = 0.5
"""Rows missing between pieces that go on without a gap."""


def joined(segments: Sequence[Segment], step_s: float) -> list[Segment]:
    """Segments in the order of time; those that go on where another of the same log ends are joined to it."""
    whole: list[list[Segment]] = []
    for segment in sorted(segments, key=lambda each: each.start_s):
        if whole and _goes_on(whole[-1][-1], segment, step_s):
            whole[-1].append(segment)
        else:
            whole.append([segment])
    return [_one(pieces) for pieces in whole]


def _goes_on(before: Segment, after: Segment, step_s: float) -> bool:
    gap = after.start_s - before.start_s - len(before.P) * step_s
    return abs(gap) < _GAP_ROWS * step_s and log_name(before.recording) == log_name(after.recording)


def _one(pieces: Sequence[Segment]) -> Segment:
    first, last = pieces[0], pieces[-1]
    shared = {name: [piece.signals[name] for piece in pieces if name in piece.signals] for name in first.signals}
    labels = {name: [piece.labels[name] for piece in pieces if name in piece.labels] for name in first.labels}
    return replace(
        first, recording=log_name(first.recording), q=np.concatenate([piece.q for piece in pieces]),
        P=np.concatenate([piece.P for piece in pieces]), tau=None, channels={}, before=first.before, after=last.after,
        signals={name: np.concatenate(each) for name, each in shared.items() if len(each) == len(pieces)},
        labels={name: np.concatenate(each) for name, each in labels.items() if len(each) == len(pieces)},
    )  # fmt: skip
