"""The chain of a description as plain numbers, for pictures of the arm: no link needs a mesh."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from acqd.robot.description import RobotDescription


def frames_of(description: RobotDescription) -> dict[str, Any]:
    """`joints`: name, axis (unit vector), whether it slides, its largest travel (m), placement in the frame before.

    `flange`: placement. A placement is [12]: the rows of [R | p], p in m.
    """
    joints = [
        {
            "name": joint.name,
            "axis": np.round(np.array(joint.axis) / np.linalg.norm(joint.axis), 6).tolist(),
            "slides": joint.slides,
            "travel": max(abs(joint.si(limit)) for limit in joint.limits) if joint.slides else 0.0,
            "at": _placement(joint.xyz, joint.rpy_deg),
        }
        for joint in description.joint
    ]
    flange = description.flange
    return {"robot": description.name, "joints": joints, "flange": _placement(flange.xyz, flange.rpy_deg)}


def _placement(xyz: Sequence[float], rpy_deg: Sequence[float]) -> list[float]:
    """Roll about x, then pitch about y, then yaw about z of the fixed frame (URDF)."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(np.radians(rpy_deg)), np.sin(np.radians(rpy_deg))
    rotation = np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )
    placement: list[float] = np.round(np.column_stack([rotation, xyz]), 6).ravel().tolist()
    return placement
