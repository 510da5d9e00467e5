"""Torque laws without a name: of a joint's angle, with hysteresis, and of accelerations."""

from __future__ import annotations

from typing import Any

import numpy as np

from acqd.arrays import Floats
from acqd.models.effects.laws.joint_law import C_OF_ANGLE, JointLaw, JointLawOfAngle, slope_of
from acqd.models.effects.laws.law import Law, MotionRange, OfLoad, Quantity, cosines, of_joint
from acqd.models.effects.places import Shape
from acqd.models.effects.scene import Scene
from acqd.models.effects.substeps import averaged

_WAVES = range(5)
"""Half waves over the range of the angle: enough for a spring, an end stop, an unbalanced weight."""
_PLAYS_RAD = (0.05, 0.2)
_PLAY_OF_LOAD = 0.15
"""Half width relative to the largest load."""


class AngleTorque(JointLawOfAngle):
    """A torque that the angle of the joint determines: a spring, a weight, an end stop."""

    id = "torque_of_angle"
    sentence = "a torque that depends on the angle of joint {joint}"
    equation = "tau = sum of c_k cos(k pi (q - q_low) / (q_high - q_low))"
    exported = True
    c_body = C_OF_ANGLE.format(waves=len(_WAVES), factor="")

    def count(self, axes: int) -> int:
        """One per wave."""
        return len(_WAVES)

    def at(self, scene: Scene, shape: Shape) -> Floats:
        """[N, waves] W/Nm."""
        slope = slope_of(scene, shape)
        return np.column_stack([slope * wave for wave in cosines(scene, shape, _WAVES)])


class Hysteresis(OfLoad, JointLaw):
    """A torque that follows the angle or the load behind a play: backlash, a gear that winds up.

    A recording starts in the middle of the play; consecutive scenes continue where the scene's memory says.
    """

    id = "torque_with_hysteresis"
    sentence = "a torque of joint {joint} with hysteresis"
    equation = "tau = sum of c_k (x - play(x, w_k)) / w_k of the angle and the load x"
    omitted_because = "its memory is not part of an FMU's state"

    def count(self, axes: int) -> int:
        """Two plays of the angle, one of the load."""
        return len(_PLAYS_RAD) + 1

    def at(self, scene: Scene, shape: Shape) -> Floats:
        """[N, 3] W/Nm."""
        slope, substeps = slope_of(scene, shape), len(scene.q) // scene.rows
        played = zip(*_inputs(scene, shape), _followed(scene, shape), strict=True)
        return np.column_stack(
            [slope * np.repeat((values - followed) / width, substeps) for values, width, followed in played]
        )

    def along(self, scene: Scene, shape: Shape) -> Quantity:
        """Angle."""
        return of_joint("angle", scene, shape, scene.q, "rad", "m")

    def remembered(self, scene: Scene, shape: Shape, rows: int) -> dict[str, Any]:
        """Where each play is after `rows`."""
        return {_memory(shape): [float(followed[rows - 1]) for followed in _followed(scene, shape)]}


def _inputs(scene: Scene, shape: Shape) -> tuple[list[Floats], list[float]]:
    """What each play follows, [T], and its half width."""
    joint = int(shape["joint"]) - 1
    angle, load = averaged(scene.q[:, joint]), averaged(scene.tau_rigid[:, joint])
    return [angle] * len(_PLAYS_RAD) + [load], [*_PLAYS_RAD, _PLAY_OF_LOAD * float(shape["heaviest_Nm"])]


def _followed(scene: Scene, shape: Shape) -> list[Floats]:
    """[T] of every play, from where the memory says."""
    values, widths = _inputs(scene, shape)
    starts = scene.memory.get(_memory(shape), [float(each[0]) for each in values])
    return [play(*each) for each in zip(values, widths, starts, strict=True)]


def _memory(shape: Shape) -> str:
    """Key in `Scene.memory`."""
    return f"plays of joint {int(shape['joint'])}"


class ReflectedInertia(Law):
    """Torques in proportion to the accelerations of all joints."""

    id = "torque_of_accelerations"
    sentence = "accelerations"
    equation = "tau_k = c_k qdd_k"
    per_joint = False
    acts_on = "torque"
    exported = True
    c_body = """
    for (int k = 0; k < AXES; k++)
        torque[k] = c[k] * p->qdd[k];
    """

    def count(self, axes: int) -> int:
        """One per joint."""
        return axes

    def shape_of(self, motion: MotionRange, joint: int) -> dict[str, float]:
        """No shape."""
        return {}

    def at(self, scene: Scene, shape: Shape) -> Floats:
        """[N, axes] W per kg m^2."""
        return scene.qdd * scene.power_per_torque

    def along(self, scene: Scene, shape: Shape) -> Quantity:
        """Largest acceleration of a joint, relative to its largest of all rows."""
        share = np.abs(scene.qdd) / np.maximum(np.abs(scene.qdd).max(axis=0), 1e-9)
        return Quantity("largest relative acceleration", "1", share.max(axis=1))


def play(values: Floats, width: float, start: float) -> Floats:
    """[T] play operator (backlash) of half width `width`: follows `values` [T] at a distance of at most the width.

    `start`: where the play was before the first value.
    """
    low, high = values - width, values + width
    reach = 1
    while reach < len(values):  # the play of several rows is that of one row with other limits: double their number
        before = low[:-reach], high[:-reach]
        low[reach:], high[reach:] = (np.minimum(np.maximum(limit, low[reach:]), high[reach:]) for limit in before)
        reach *= 2
    return np.minimum(np.maximum(start, low), high)
