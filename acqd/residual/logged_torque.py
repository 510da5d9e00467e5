"""Where a recording has joint torques: behind the gear from sensors, or at the motor from its current."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, get_args

import numpy as np

from acqd.arrays import Floats
from acqd.models.segments import Segment

Side = Literal["link", "motor"]
"""A torque sensor behind the gear sees the link; a motor current sees friction and rotor too."""


def side_of(segments: Sequence[Segment]) -> Side | None:
    """Where most of the segments have a torque; None if most have none."""
    for side in get_args(Side):
        if sum(has_torque(segment, side) for segment in segments) > len(segments) / 2:
            return side  # type: ignore[no-any-return]
    return None


def has_torque(segment: Segment, side: Side) -> bool:
    """Whether a segment has torques of that side without gaps; a column of zeros was not measured."""
    values = logged(segment, side)
    return values is not None and bool(np.isfinite(values).all()) and bool(np.abs(values).max(initial=0.0) > 0)


def logged(segment: Segment, side: Side) -> Floats | None:
    """[T, axes] Nm of torque sensors, or A of motors; None where the recording has none."""
    return segment.tau if side == "link" else segment.channels.get("current")
