"""Unnamed torque laws of a joint: of its angle, its load, its speed, the speeds of other joints, and with memory.

A spring, a worn tooth, friction of another curve, a coupling of two axes, backlash: laws that no effect of the library
holds. Their power is torque times the power per torque, so that they compete with the torques of named effects.
"""

from __future__ import annotations

import numpy as np

from acqd.arrays import Floats
from acqd.models.effects.scene import Scene
from acqd.models.effects.substeps import averaged
from acqd.models.greybox.model import direction

_WAVES = 4
"""Half waves over the range of the angle: enough for a spring, an end stop, an unbalanced weight."""
_FRICTION_WAVES = 3
"""Of friction: dry grease in one place, a cable that rubs near an end, an oval bearing."""
_KNOTS = (0.0, 0.1, 0.3, 0.6, 0.85)
"""Of a friction curve in straight pieces, relative to the speed that few rows exceed; the last piece has no end."""
_BEGINNINGS = (1, 2, 3)
"""Knots above which a friction of one coefficient may begin."""
_PLAYS_RAD = (0.05, 0.2)
_PLAY_OF_LOAD = 0.15
"""Half width relative to the largest load."""


def torque_columns(scene: Scene, angles: tuple[Floats, Floats], fastest: Floats, heaviest: Floats) -> list[Floats]:
    """Columns [N] W at substeps in the order of `torque_groups`.

    Of all recordings: `angles` [axes] rad, smallest and largest; `fastest` [axes] rad/s, which few rows exceed;
    `heaviest` [axes] Nm, largest loads.
    """
    low, high = angles
    columns: list[Floats] = []
    phase = np.pi * (scene.q - low) / np.maximum(high - low, 1e-6)
    for joint in range(scene.axes):
        slope = scene.power_per_torque[:, joint]
        columns += [slope * np.cos(wave * phase[:, joint]) for wave in range(_WAVES + 1)]
    against = direction(scene.qd)
    for joint in range(scene.axes):
        slope = scene.power_per_torque[:, joint] * against[:, joint]
        columns += [slope * np.cos(wave * phase[:, joint]) for wave in range(_FRICTION_WAVES + 1)]
    for joint in range(scene.axes):
        load = np.abs(scene.tau_rigid[:, joint])
        slope = scene.power_per_torque[:, joint] * against[:, joint]
        columns += [slope * load, slope * load**2 / heaviest[joint]]
    for joint in range(scene.axes):
        slope = scene.power_per_torque[:, joint] * against[:, joint]
        others = [other for other in range(scene.axes) if other != joint]
        columns += [slope * np.abs(scene.qd[:, other]) for other in others]
    share = np.abs(scene.qd) / fastest
    for joint in range(scene.axes):
        slope = scene.power_per_torque[:, joint] * against[:, joint]
        columns += [slope, *(slope * np.maximum(share[:, joint] - knot, 0.0) for knot in _KNOTS)]
    substeps = len(scene.q) // scene.rows
    angle, load = averaged(scene.q), averaged(scene.tau_rigid)
    widths = [*(np.full(scene.axes, width) for width in _PLAYS_RAD), _PLAY_OF_LOAD * heaviest]
    followed = [
        (values - play(values, width)) / width for values, width in zip((angle, angle, load), widths, strict=True)
    ]
    for joint in range(scene.axes):
        slope = scene.power_per_torque[:, joint]
        columns += [slope * np.repeat(each[:, joint], substeps) for each in followed]
    return columns


def play(values: Floats, width: Floats) -> Floats:
    """[T, k] play operator (backlash) of half width [k]: follows `values` [T, k] at a distance of at most the width."""
    followed = np.empty_like(values)
    at = values[0].copy()
    for row, (low, high) in enumerate(zip(values - width, values + width, strict=True)):
        at = np.minimum(np.maximum(at, low), high)
        followed[row] = at
    return followed


def torque_groups(axes: int) -> list[tuple[str, int]]:
    """Name and number of columns of every group."""
    joints = range(1, axes + 1)
    coupled = joints if axes > 1 else ()
    return [
        *((f"a torque that depends on the angle of joint {joint}", _WAVES + 1) for joint in joints),
        *((f"a friction that depends on the angle of joint {joint}", _FRICTION_WAVES + 1) for joint in joints),
        *((f"a friction that depends on the load of joint {joint}", 2) for joint in joints),
        *((_coupling(joint), axes - 1) for joint in coupled),
        *((_curve(joint), len(_KNOTS) + 1) for joint in joints),
        *((f"a torque of joint {joint} with hysteresis", len(_PLAYS_RAD) + 1) for joint in joints),
    ]


def single_laws(axes: int) -> list[tuple[str, int, int]]:
    """Name, column and number of equally likely laws: single columns of the groups, which cost one coefficient.

    A friction of a joint that grows with the speed of one other joint, or that begins above a speed. Beside them, a
    group with a coefficient for every other joint or every piece of the curve pays for what it does not need.
    """
    first, place = {}, 0
    for name, count in torque_groups(axes):
        first[name], place = place, place + count
    laws = []
    for joint in range(1, axes + 1):
        others = [other for other in range(1, axes + 1) if other != joint]
        for number, other in enumerate(others):
            column = first[_coupling(joint)] + number
            laws.append(
                (f"a friction of joint {joint} that grows with the speed of joint {other}", column, len(others))
            )
        for knot in _BEGINNINGS:
            above = f"a friction of joint {joint} that begins above {_KNOTS[knot]:.0%} of its highest speed"
            laws.append((above, first[_curve(joint)] + 1 + knot, len(_BEGINNINGS)))
    return laws


def _coupling(joint: int) -> str:
    return f"a friction of joint {joint} that depends on the speeds of other joints"


def _curve(joint: int) -> str:
    return f"a friction of joint {joint} of another curve over its speed"
