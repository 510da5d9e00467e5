"""Friction laws without a name: of a joint's angle, load and speed, and of the speeds of other joints."""

from __future__ import annotations

import numpy as np

from acqd.arrays import Floats
from acqd.models.effects.laws.joint_law import C_OF_ANGLE, JointLaw, JointLawOfAngle, against
from acqd.models.effects.laws.law import MotionRange, OfLoad, OfSpeed, cosines
from acqd.models.effects.places import Shape
from acqd.models.effects.scene import Scene
from acqd.models.greybox.model import GreyBox

_WAVES = range(4)
"""Half waves over the angle: dry grease in one place, a cable that rubs near an end, an oval bearing."""
KNOTS = (0.0, 0.1, 0.3, 0.6, 0.85)
"""Of a friction curve in straight pieces, relative to the speed that few rows exceed; the last piece has no end."""


class AngleFriction(JointLawOfAngle):
    """A friction that the angle of the joint determines: dry grease in one place, an oval bearing."""

    id = "friction_of_angle"
    sentence = "a friction that depends on the angle of joint {joint}"
    equation = "tau = sign(qd) sum of c_k cos(k pi (q - q_low) / (q_high - q_low))"
    exported = True
    c_body = C_OF_ANGLE.format(waves=len(_WAVES), factor=" * p->direction[joint]")

    def count(self, axes: int) -> int:
        """One per wave."""
        return len(_WAVES)

    def at(self, scene: Scene, shape: Shape) -> Floats:
        """[N, waves] W/Nm."""
        friction = against(scene, shape)
        return np.column_stack([friction * wave for wave in cosines(scene, shape, _WAVES)])


class LoadFriction(OfLoad, JointLaw):
    """A friction that grows with the load of the joint, along a curve."""

    id = "friction_of_load"
    sentence = "a friction that depends on the load of joint {joint}"
    equation = "tau = sign(qd) (c_1 |tau_load| + c_2 tau_load^2 / tau_largest)"
    exported = True
    c_body = """
    const lanes_t load = lanes_abs(p->tau_rigid[joint]);
    torque[joint] = p->direction[joint] * (c[0] * load + c[1] * load * load / heaviest_Nm);
    """

    def count(self, axes: int) -> int:
        """Linear and square."""
        return 2

    def at(self, scene: Scene, shape: Shape) -> Floats:
        """[N, 2] W/Nm, per share of the load."""
        load = np.abs(scene.tau_rigid[:, int(shape["joint"]) - 1])
        friction = against(scene, shape)
        return np.column_stack([friction * load, friction * load**2 / shape["heaviest_Nm"]])


class CoupledFriction(OfSpeed, JointLaw):
    """A friction that grows with the speeds of other joints: a belt or a cable that couples two axes."""

    id = "friction_of_other_speeds"
    sentence = "a friction of joint {joint} that depends on the speeds of other joints"
    equation = "tau = sign(qd) sum of c_k |qd_k| over the other joints k"
    exported = True
    c_body = """
    for (int k = 0, column = 0; k < AXES; k++)
        if (k != joint)
            torque[joint] += c[column++] * p->direction[joint] * lanes_abs(p->qd[k]);
    """

    def count(self, axes: int) -> int:
        """One per other joint."""
        return axes - 1

    def joints(self, axes: int) -> range:
        """None on a robot of one axis."""
        return range(1, axes + 1) if axes > 1 else range(0)

    def shape_of(self, motion: MotionRange, joint: int) -> dict[str, float]:
        """The joint alone."""
        return {"joint": joint}

    def at(self, scene: Scene, shape: Shape) -> Floats:
        """[N, axes - 1] W per Nm s/rad."""
        friction = against(scene, shape)
        others = np.delete(np.arange(scene.axes), int(shape["joint"]) - 1)
        return np.column_stack([friction * np.abs(scene.qd[:, other]) for other in others])


class CurvedFriction(OfSpeed, JointLaw):
    """A friction of any curve over the speed of the joint."""

    id = "friction_of_speed"
    sentence = "a friction of joint {joint} of another curve over its speed"
    equation = "tau = sign(qd) (c_0 + sum of c_k max(|qd| / qd_fast - s_k, 0))"
    exported = True
    c_body = """
    const lanes_t share = lanes_abs(p->qd[joint]) / fastest_rad_s;
    torque[joint] = lanes_of(c[0]);
    for (int k = 0; k < KNOT_COUNT; k++)
        torque[joint] += c[k + 1] * lanes_max(share - knots[k], ZERO);
    torque[joint] *= p->direction[joint];
    """.replace("KNOT_COUNT", str(len(KNOTS)))

    def count(self, axes: int) -> int:
        """The friction at standstill and the slopes after the knots."""
        return len(KNOTS) + 1

    def at(self, scene: Scene, shape: Shape) -> Floats:
        """[N, knots + 1] W/Nm."""
        share = np.abs(scene.qd[:, int(shape["joint"]) - 1]) / shape["fastest_rad_s"]
        friction = against(scene, shape)
        return np.column_stack([friction, *(friction * np.maximum(share - knot, 0.0) for knot in KNOTS)])

    def c_constants(self, carrier: GreyBox, shape: Shape) -> dict[str, float | Floats]:
        """Also the knots."""
        return {**super().c_constants(carrier, shape), "knots": np.array(KNOTS)}
