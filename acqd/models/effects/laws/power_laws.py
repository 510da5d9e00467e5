"""Power laws without a name: of whether the arm moves, of a joint's angle or speed, of the predicted power."""

from __future__ import annotations

import numpy as np

from acqd.arrays import Floats
from acqd.models.effects.laws.law import Law, MotionRange, OfAngle, OfSpeed, Quantity, cosines
from acqd.models.effects.places import Shape
from acqd.models.effects.scene import Scene

_SPEEDS = tuple(0.05 + 0.1 * k for k in range(10))
"""Middles of bells over the speed, relative to the speed that few rows exceed."""
_BELL = 0.08
_WAVES = range(1, 7)
_MOVING_RAD_S = 0.01


class _PowerLaw(Law):
    """A power before the supply's lag."""

    omitted_because = "an FMU holds no power that has no physical law"


class PowerOfMoving(_PowerLaw):
    """A constant power while any joint moves."""

    id = "power_while_moving"
    sentence = "whether the arm moves"
    equation = "P = c while any joint moves"
    per_joint = False

    def count(self, axes: int) -> int:
        """A single column."""
        return 1

    def shape_of(self, motion: MotionRange, joint: int) -> dict[str, float]:
        """No shape."""
        return {}

    def at(self, scene: Scene, shape: Shape) -> Floats:
        """[N, 1] 0/1."""
        return moving(scene)[:, None]

    def along(self, scene: Scene, shape: Shape) -> Quantity:
        """Speed of the fastest joint."""
        return Quantity("speed of the fastest joint", "rad/s", np.abs(scene.qd).max(axis=1))


class PowerOfAngle(OfAngle, _PowerLaw):
    """A power that depends on the angle of a joint."""

    id = "power_of_angle"
    sentence = "the angle of joint {joint}"
    equation = "P = sum of c_k cos(k pi (q - q_low) / (q_high - q_low))"

    def count(self, axes: int) -> int:
        """One per wave."""
        return len(_WAVES)

    def at(self, scene: Scene, shape: Shape) -> Floats:
        """[N, waves] W/W."""
        return np.column_stack(cosines(scene, shape, _WAVES))


class PowerOfSpeed(OfSpeed, _PowerLaw):
    """A power that depends on the speed of a joint."""

    id = "power_of_speed"
    sentence = "the speed of joint {joint}"
    equation = "P = sum of c_k exp(-((|qd| / qd_fast - s_k) / 0.08)^2)"

    def count(self, axes: int) -> int:
        """One per bell."""
        return len(_SPEEDS)

    def at(self, scene: Scene, shape: Shape) -> Floats:
        """[N, bells] W/W; above the recorded speeds, the last bell holds."""
        share = np.minimum(np.abs(scene.qd[:, int(shape["joint"]) - 1]) / shape["fastest_rad_s"], 1.0)
        return np.column_stack([np.exp(-(((share - middle) / _BELL) ** 2)) for middle in _SPEEDS])


class PowerAboveLevels(_PowerLaw):
    """A power in straight pieces over the predicted power."""

    id = "power_of_power"
    sentence = "the power itself"
    equation = "P = sum of c_k max(P_predicted - P_k, 0)"
    per_joint = False

    def count(self, axes: int) -> int:
        """One per level."""
        return 4

    def shape_of(self, motion: MotionRange, joint: int) -> dict[str, float]:
        """Four levels."""
        return {f"level_{k + 1}_W": float(level) for k, level in enumerate(motion.power)}

    def at(self, scene: Scene, shape: Shape) -> Floats:
        """[N, 4] W/W."""
        predicted = np.repeat(scene.predicted, len(scene.q) // scene.rows)
        return np.column_stack([np.maximum(predicted - shape[f"level_{k + 1}_W"], 0.0) for k in range(4)])

    def along(self, scene: Scene, shape: Shape) -> Quantity:
        """Predicted power."""
        return Quantity("predicted power", "W", np.repeat(scene.predicted, len(scene.q) // scene.rows))


def moving(scene: Scene) -> Floats:
    """[N] 1 while any joint moves, else 0."""
    return np.asarray((np.abs(scene.qd).max(axis=1) > _MOVING_RAD_S) * 1.0)
