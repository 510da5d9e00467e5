"""A torque at one joint, as a law without a name."""

from __future__ import annotations

import numpy as np

from acqd.arrays import Floats
from acqd.models.effects.laws.law import Law, OfAngle
from acqd.models.effects.places import Shape
from acqd.models.effects.scene import Scene
from acqd.models.greybox.model import GreyBox

C_OF_ANGLE = """
const lanes_t phase = 3.14159265358979323846 * (p->q[joint] - low_rad) / range_rad;
for (int wave = 0; wave < {waves}; wave++) {{
    lanes_t sine, cosine;
    lanes_sincos(wave * phase, &sine, &cosine);
    torque[joint] += c[wave] * cosine{factor};
}}
"""
"""Half waves over the range of the angle: `waves` of them, times a `factor`."""


class JointLaw(Law):
    """A torque at one joint."""

    acts_on = "torque"

    def c_constants(self, carrier: GreyBox, shape: Shape) -> dict[str, float | Floats]:
        """Joint (from 0), and the numbers of the shape."""
        numbers: dict[str, float | Floats] = {name: float(value) for name, value in shape.items() if name != "begin_s"}
        return numbers | {"joint": int(shape["joint"]) - 1}


class JointLawOfAngle(OfAngle, JointLaw):
    """A torque scaled to the range of the joint's angle."""

    def c_constants(self, carrier: GreyBox, shape: Shape) -> dict[str, float | Floats]:
        """Joint, lower end and length of the range."""
        range_rad = max(shape["high_rad"] - shape["low_rad"], 1e-6)
        return {"joint": int(shape["joint"]) - 1, "low_rad": float(shape["low_rad"]), "range_rad": float(range_rad)}


def slope_of(scene: Scene, shape: Shape) -> Floats:
    """[N] W/Nm of the law's joint."""
    return np.asarray(scene.power_per_torque[:, int(shape["joint"]) - 1])


def against(scene: Scene, shape: Shape) -> Floats:
    """[N] W per Nm of friction of the law's joint."""
    joint = int(shape["joint"]) - 1
    return np.asarray(scene.power_per_torque[:, joint] * scene.model.direction(scene.qd[:, joint]))
