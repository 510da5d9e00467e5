"""What all laws without a name have in common: a sentence, a range of motion that scales them, no places to search."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from acqd.arrays import Floats
from acqd.models.effects.cause import Cause
from acqd.models.effects.effect import Effect
from acqd.models.effects.places import Place, Shape
from acqd.models.effects.scene import Scene


@dataclass(frozen=True, slots=True)
class MotionRange:
    """What the recordings cover: flexible functions are scaled to it."""

    low: Floats
    """[axes] rad, or m of a prismatic joint."""
    high: Floats
    speed: Floats
    """[axes] rad/s, which few rows exceed."""
    load: Floats
    """[axes] Nm, the largest rigid-body torque."""
    power: Floats
    """[4] W: quantiles of the predicted power."""


@dataclass(frozen=True, slots=True)
class Quantity:
    """What a law depends on, for a picture."""

    name: str
    unit: str
    values: Floats
    """[N] at substeps."""


class Law(Effect):
    """A flexible function without a name. Its shape holds the joint (from 1) and the range that scales the function."""

    cause = Cause.UNNAMED
    sentence: ClassVar[str]
    """What the residual follows, with `{joint}`."""
    per_joint: ClassVar[bool] = True
    """One law for every joint, or one for the whole robot."""
    experiment = "record what may cause it together with the power"
    exported = False

    def __init_subclass__(cls) -> None:
        """The summary is the sentence about any joint."""
        super().__init_subclass__()
        if "sentence" in cls.__dict__:
            cls.summary = cls.sentence.replace("joint {joint}", "a joint")

    @property
    def sized_in(self) -> str:
        """Unit of the law's size."""
        return "Nm" if self.acts_on == "torque" else "W"

    @abstractmethod
    def count(self, axes: int) -> int:
        """Number of columns of `at`."""

    @abstractmethod
    def shape_of(self, motion: MotionRange, joint: int) -> dict[str, float]:
        """Shape for a joint (from 1; 0 for the whole robot) in recordings that cover `motion`."""

    @abstractmethod
    def along(self, scene: Scene, shape: Shape) -> Quantity:
        """The quantity that the law depends on most."""

    def label(self, joint: int) -> str:
        """What the residual follows: "a torque that depends on the angle of joint 2"."""
        return self.sentence.format(joint=joint)

    def joints(self, axes: int) -> range:
        """Joints that the law can act on, from 1; 0 alone for a law of the whole robot."""
        return range(1, axes + 1) if self.per_joint else range(1)

    def places(self, scene: Scene) -> Iterator[Place]:
        """None: laws have no place in the library's search."""
        return iter(())


class OfAngle(Law):
    """Scaled to the range of the joint's angle, and drawn over that angle."""

    def shape_of(self, motion: MotionRange, joint: int) -> dict[str, float]:
        """Smallest and largest recorded angle."""
        return {"joint": joint, "low_rad": motion.low[joint - 1], "high_rad": motion.high[joint - 1]}

    def along(self, scene: Scene, shape: Shape) -> Quantity:
        """Angle."""
        return of_joint("angle", scene, shape, scene.q, "rad", "m")


class OfSpeed(Law):
    """Scaled to a high speed of the joint, and drawn over the speed."""

    def shape_of(self, motion: MotionRange, joint: int) -> dict[str, float]:
        """A high speed."""
        return {"joint": joint, "fastest_rad_s": motion.speed[joint - 1]}

    def along(self, scene: Scene, shape: Shape) -> Quantity:
        """Speed."""
        return of_joint("speed", scene, shape, scene.qd, "rad/s", "m/s")


class OfLoad(Law):
    """Scaled to the largest load of the joint, and drawn over the load."""

    def shape_of(self, motion: MotionRange, joint: int) -> dict[str, float]:
        """Largest load."""
        return {"joint": joint, "heaviest_Nm": motion.load[joint - 1]}

    def along(self, scene: Scene, shape: Shape) -> Quantity:
        """Rigid-body torque."""
        return of_joint("load", scene, shape, scene.tau_rigid, "Nm", "N")


def of_joint(name: str, scene: Scene, shape: Shape, values: Floats, turning: str, sliding: str) -> Quantity:
    """Column of `values` [N, axes] of the law's joint, in the unit of a turning or a sliding joint."""
    joint = int(shape["joint"]) - 1
    unit = sliding if joint in scene.model.layout.sliding else turning
    return Quantity(f"{name} of joint {joint + 1}", unit, np.asarray(values[:, joint]))


def cosines(scene: Scene, shape: Shape, waves: range) -> list[Floats]:
    """[N] each: half waves over the range of the angle of the law's joint, which ends at the recorded limits."""
    low, high = shape["low_rad"], shape["high_rad"]
    angle = scene.q[:, int(shape["joint"]) - 1]
    phase = np.pi * (angle - low) / max(high - low, 1e-6)
    return [np.cos(wave * phase) for wave in waves]
