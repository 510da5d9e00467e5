"""Unnamed torque laws of a joint: of its angle, of its load, of the speeds of other joints.

A spring, a counterweight, a worn tooth, a coupling of two axes: laws that no effect of the library holds. Their power
is torque times the power per torque, so that they compete with the torques of named effects.
"""

from __future__ import annotations

import numpy as np

from acqd.arrays import Floats
from acqd.models.effects.scene import Scene
from acqd.models.greybox.model import direction

_WAVES = 4
"""Half waves over the range of the angle: enough for a spring, an end stop, an unbalanced weight."""
_SMOOTH_RAD_S = 0.05


def torque_columns(scene: Scene, low: Floats, high: Floats) -> list[Floats]:
    """Columns [N] W at substeps in the order of `torque_groups`; `low`, `high` [axes] rad: ranges of the angles."""
    columns: list[Floats] = []
    phase = np.pi * (scene.q - low) / np.maximum(high - low, 1e-6)
    for joint in range(scene.axes):
        slope = scene.power_per_torque[:, joint]
        columns += [slope * np.cos(wave * phase[:, joint]) for wave in range(_WAVES + 1)]
    against = direction(scene.qd)
    for joint in range(scene.axes):
        load = np.abs(scene.tau_rigid[:, joint])
        slope = scene.power_per_torque[:, joint] * against[:, joint]
        columns += [slope * load, slope * load**2 / np.maximum(load.max(), 1e-9)]
    for joint in range(scene.axes):
        slope = scene.power_per_torque[:, joint]
        speed = scene.qd[:, joint] / np.hypot(scene.qd[:, joint], _SMOOTH_RAD_S)
        others = [other for other in range(scene.axes) if other != joint]
        columns += [slope * speed * np.abs(scene.qd[:, joint] * scene.qd[:, other]) for other in others]
    return columns


def torque_groups(axes: int) -> list[tuple[str, int]]:
    """Name and number of columns of every group."""
    joints = range(1, axes + 1)
    return [
        *((f"a torque that depends on the angle of joint {joint}", _WAVES + 1) for joint in joints),
        *((f"a friction that depends on the load of joint {joint}", 2) for joint in joints),
        *((f"a friction of joint {joint} that depends on the speeds of other joints", axes - 1) for joint in joints),
    ]
