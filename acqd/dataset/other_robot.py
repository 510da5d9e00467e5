"""Whether torques or currents of logs are those of another shipped robot with as many axes.

Arms of a family have the same joints in another size, so that their angles do not tell them apart. Their torques do:
the large arm needs several times the torque of the small one, and the weights of its links are distributed otherwise.
A payload or wrong gains make torques larger, too; hence both signs are asked for.
"""

from __future__ import annotations

from collections.abc import Sequence

from acqd.dataset.axis_order import OrderSample, explains_better
from acqd.robot.description import RobotDescription, load_description, shipped_descriptions

_OTHER_SIZE = 1.5
"""Logged over described torque. Real UR10e arms with up to 3 kg: 0.87 to 1.17, described as a UR5e: 1.8 to 2.4."""


def other_robot(robot: RobotDescription, samples: Sequence[OrderSample]) -> str:
    """A line on another shipped robot that explains torques or currents clearly better; empty without one."""
    gains: dict[str, float] = {}
    for name in shipped_descriptions():
        other = load_description(name)
        if other.axes != robot.axes or name == robot.name:
            continue
        better = explains_better(robot, other, samples)
        if better is None:
            return ""
        if better.clearly and not _same_size(better.slope) and _same_size(better.slope_of_other):
            gains[name] = better.gain
    if not gains:
        return ""
    best = max(gains, key=lambda name: gains[name])
    return (
        f"torques and angles fit {best} better than {robot.name}, and not only because of a payload: are these logs of "
        f"{robot.name}?"
    )


def _same_size(slope: float) -> bool:
    return 1 / _OTHER_SIZE < slope < _OTHER_SIZE
