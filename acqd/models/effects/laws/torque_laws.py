"""Torque laws without a name: of a joint's angle, with hysteresis, and of accelerations."""

from __future__ import annotations

import numpy as np

from acqd.arrays import Floats
from acqd.models.effects.laws.joint_law import C_OF_ANGLE, JointLaw, LawOfAngle, slope_of
from acqd.models.effects.laws.law import Law, MotionRange, Quantity, angle_of, cosines
from acqd.models.effects.places import Shape
from acqd.models.effects.scene import Scene
from acqd.models.effects.substeps import averaged

_WAVES = range(5)
"""Half waves over the range of the angle: enough for a spring, an end stop, an unbalanced weight."""
_PLAYS_RAD = (0.05, 0.2)
_PLAY_OF_LOAD = 0.15
"""Half width relative to the largest load."""


class AngleTorque(LawOfAngle):
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


class Hysteresis(JointLaw):
    """A torque that follows the angle or the load behind a play: backlash, a gear that winds up.

    A prediction row by row knows the last seconds of the motion only, and with them the side of the play.
    """

    id = "torque_with_hysteresis"
    sentence = "a torque of joint {joint} with hysteresis"
    equation = "tau = sum of c_k (x - play(x, w_k)) / w_k of the angle and the load x"
    omitted_because = "its memory is not part of an FMU's state"

    def count(self, axes: int) -> int:
        """Two plays of the angle, one of the load."""
        return len(_PLAYS_RAD) + 1

    def shape_of(self, motion: MotionRange, joint: int) -> dict[str, float]:
        """Largest load."""
        return {"joint": joint, "heaviest_Nm": motion.load[joint - 1]}

    def at(self, scene: Scene, shape: Shape) -> Floats:
        """[N, 3] W/Nm; every recording starts in the middle of the play."""
        joint, substeps = int(shape["joint"]) - 1, len(scene.q) // scene.rows
        angle, load = averaged(scene.q[:, joint]), averaged(scene.tau_rigid[:, joint])
        plays = [*((angle, width) for width in _PLAYS_RAD), (load, _PLAY_OF_LOAD * float(shape["heaviest_Nm"]))]
        slope = slope_of(scene, shape)
        wound = [np.repeat((values - play(values, width)) / width, substeps) for values, width in plays]
        return np.column_stack([slope * each for each in wound])

    def along(self, scene: Scene, shape: Shape) -> Quantity:
        """Angle."""
        return angle_of(scene, shape)


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


def play(values: Floats, width: float) -> Floats:
    """[T] play operator (backlash) of half width `width`: follows `values` [T] at a distance of at most the width."""
    followed = np.empty_like(values)
    at = float(values[0])
    for row, value in enumerate(values.tolist()):
        at = min(max(at, value - width), value + width)
        followed[row] = at
    return followed
