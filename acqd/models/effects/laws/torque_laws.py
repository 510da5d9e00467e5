"""Torque laws without a name: of a joint's angle, load, speed, the speeds of other joints, and with memory.

A spring, a worn tooth, friction of another curve, a coupling of two axes, backlash. Their power is torque times the
power per torque, so that they compete with the torques of named effects.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from acqd.arrays import Floats
from acqd.models.effects.laws.law import Law, MotionRange, Quantity, angle_of, cosines, load_of, speed_of
from acqd.models.effects.places import Shape
from acqd.models.effects.scene import Scene
from acqd.models.effects.substeps import averaged
from acqd.models.greybox.model import GreyBox, direction

_WAVES = range(5)
"""Half waves over the range of the angle: enough for a spring, an end stop, an unbalanced weight."""
_FRICTION_WAVES = range(4)
"""Of friction: dry grease in one place, a cable that rubs near an end, an oval bearing."""
KNOTS = (0.0, 0.1, 0.3, 0.6, 0.85)
"""Of a friction curve in straight pieces, relative to the speed that few rows exceed; the last piece has no end."""
_PLAYS_RAD = (0.05, 0.2)
_PLAY_OF_LOAD = 0.15
"""Half width relative to the largest load."""
_C_OF_ANGLE = """
const lanes_t phase = 3.14159265358979323846 * (p->q[joint] - low_rad) / range_rad;
for (int wave = 0; wave < {waves}; wave++) {{
    lanes_t sine, cosine;
    lanes_sincos(wave * phase, &sine, &cosine);
    torque[joint] += c[wave] * cosine{factor};
}}
"""


class _TorqueLaw(Law):
    """A torque at one joint."""

    acts_on = "torque"

    def c_constants(self, carrier: GreyBox, shape: Shape) -> dict[str, float | Floats]:
        """Joint (from 0), and the numbers of the shape."""
        numbers: dict[str, float | Floats] = {name: float(value) for name, value in shape.items() if name != "begin_s"}
        return numbers | {"joint": int(shape["joint"]) - 1}


class _OfAngle(_TorqueLaw):
    """Scaled to the range of the joint's angle."""

    def shape_of(self, motion: MotionRange, joint: int) -> dict[str, float]:
        """Smallest and largest recorded angle."""
        return {"joint": joint, "low_rad": motion.low[joint - 1], "high_rad": motion.high[joint - 1]}

    def along(self, scene: Scene, shape: Shape) -> Quantity:
        """Angle."""
        return angle_of(scene, shape)

    def c_constants(self, carrier: GreyBox, shape: Shape) -> dict[str, float | Floats]:
        """Joint, lower end and length of the range."""
        range_rad = max(shape["high_rad"] - shape["low_rad"], 1e-6)
        return {"joint": int(shape["joint"]) - 1, "low_rad": float(shape["low_rad"]), "range_rad": float(range_rad)}


class AngleTorque(_OfAngle):
    """A torque that the angle of the joint determines: a spring, a weight, an end stop."""

    id = "torque_of_angle"
    summary = sentence = "a torque that depends on the angle of joint {joint}"
    equation = "tau = sum of c_k cos(k pi (q - q_low) / (q_high - q_low))"
    exported = True
    c_body = _C_OF_ANGLE.format(waves=len(_WAVES), factor="")

    def count(self, axes: int) -> int:
        """One per wave."""
        return len(_WAVES)

    def at(self, scene: Scene, shape: Shape) -> Floats:
        """[N, waves] W/Nm."""
        slope = _slope(scene, shape)
        return np.column_stack([slope * wave for wave in cosines(scene, shape, _WAVES)])


class AngleFriction(_OfAngle):
    """A friction that the angle of the joint determines: dry grease in one place, an oval bearing."""

    id = "friction_of_angle"
    summary = sentence = "a friction that depends on the angle of joint {joint}"
    equation = "tau = sign(qd) sum of c_k cos(k pi (q - q_low) / (q_high - q_low))"
    exported = True
    c_body = _C_OF_ANGLE.format(waves=len(_FRICTION_WAVES), factor=" * p->direction[joint]")

    def count(self, axes: int) -> int:
        """One per wave."""
        return len(_FRICTION_WAVES)

    def at(self, scene: Scene, shape: Shape) -> Floats:
        """[N, waves] W/Nm."""
        against = _against(scene, shape)
        return np.column_stack([against * wave for wave in cosines(scene, shape, _FRICTION_WAVES)])


class LoadFriction(_TorqueLaw):
    """A friction that grows with the load of the joint, along a curve."""

    id = "friction_of_load"
    summary = sentence = "a friction that depends on the load of joint {joint}"
    equation = "tau = sign(qd) (c_1 |tau_load| + c_2 tau_load^2 / tau_largest)"
    exported = True
    c_body = """
    const lanes_t load = lanes_abs(p->tau_rigid[joint]);
    torque[joint] = p->direction[joint] * (c[0] * load + c[1] * load * load / heaviest_Nm);
    """

    def count(self, axes: int) -> int:
        """Linear and square."""
        return 2

    def shape_of(self, motion: MotionRange, joint: int) -> dict[str, float]:
        """Largest load."""
        return {"joint": joint, "heaviest_Nm": motion.load[joint - 1]}

    def at(self, scene: Scene, shape: Shape) -> Floats:
        """[N, 2] W/Nm, per share of the load."""
        load = np.abs(scene.tau_rigid[:, int(shape["joint"]) - 1])
        against = _against(scene, shape)
        return np.column_stack([against * load, against * load**2 / shape["heaviest_Nm"]])

    def along(self, scene: Scene, shape: Shape) -> Quantity:
        """Load."""
        return load_of(scene, shape)


class CoupledFriction(_TorqueLaw):
    """A friction that grows with the speeds of other joints: a belt or a cable that couples two axes."""

    id = "friction_of_other_speeds"
    summary = sentence = "a friction of joint {joint} that depends on the speeds of other joints"
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
        against = _against(scene, shape)
        others = np.delete(np.arange(scene.axes), int(shape["joint"]) - 1)
        return np.column_stack([against * np.abs(scene.qd[:, other]) for other in others])

    def along(self, scene: Scene, shape: Shape) -> Quantity:
        """Speed."""
        return speed_of(scene, shape)


class CurvedFriction(_TorqueLaw):
    """A friction of any curve over the speed of the joint."""

    id = "friction_of_speed"
    summary = sentence = "a friction of joint {joint} of another curve over its speed"
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

    def shape_of(self, motion: MotionRange, joint: int) -> dict[str, float]:
        """A high speed."""
        return {"joint": joint, "fastest_rad_s": motion.speed[joint - 1]}

    def at(self, scene: Scene, shape: Shape) -> Floats:
        """[N, knots + 1] W/Nm."""
        share = np.abs(scene.qd[:, int(shape["joint"]) - 1]) / shape["fastest_rad_s"]
        against = _against(scene, shape)
        return np.column_stack([against, *(against * np.maximum(share - knot, 0.0) for knot in KNOTS)])

    def along(self, scene: Scene, shape: Shape) -> Quantity:
        """Speed."""
        return speed_of(scene, shape)

    def c_constants(self, carrier: GreyBox, shape: Shape) -> dict[str, float | Floats]:
        """Also the knots."""
        return {**super().c_constants(carrier, shape), "knots": np.array(KNOTS)}


class Hysteresis(_TorqueLaw):
    """A torque that follows the angle or the load behind a play: backlash, a gear that winds up.

    A prediction row by row knows the last seconds of the motion only, and with them the side of the play.
    """

    id = "torque_with_hysteresis"
    summary = sentence = "a torque of joint {joint} with hysteresis"
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
        slope = _slope(scene, shape)
        wound = [np.repeat((values - play(values, width)) / width, substeps) for values, width in plays]
        return np.column_stack([slope * each for each in wound])

    def along(self, scene: Scene, shape: Shape) -> Quantity:
        """Angle."""
        return angle_of(scene, shape)


class ReflectedInertia(Law):
    """Torques in proportion to the accelerations of all joints."""

    id = "torque_of_accelerations"
    summary = sentence = "accelerations"
    equation = "tau_k = c_k qdd_k"
    per_joint = False
    acts_on = "torque"
    exported = True
    shapes: ClassVar = ({},)
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


TORQUE_LAWS: tuple[Law, ...] = (
    AngleTorque(), AngleFriction(), LoadFriction(), CoupledFriction(), CurvedFriction(), Hysteresis(),
)  # fmt: skip
"""Of one joint, in the order of their columns."""


def play(values: Floats, width: float) -> Floats:
    """[T] play operator (backlash) of half width `width`: follows `values` [T] at a distance of at most the width."""
    followed = np.empty_like(values)
    at = float(values[0])
    for row, value in enumerate(values.tolist()):
        at = min(max(at, value - width), value + width)
        followed[row] = at
    return followed


def _slope(scene: Scene, shape: Shape) -> Floats:
    """[N] W/Nm of the law's joint."""
    return np.asarray(scene.power_per_torque[:, int(shape["joint"]) - 1])


def _against(scene: Scene, shape: Shape) -> Floats:
    """[N] W per Nm of friction of the law's joint."""
    joint = int(shape["joint"]) - 1
    return np.asarray(scene.power_per_torque[:, joint] * direction(scene.qd[:, joint]))
