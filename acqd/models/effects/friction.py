"""Friction of gears and bearings: torques against the motion, so their power is lost whichever way the arm goes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar

import numpy as np

from acqd.arrays import Floats
from acqd.models.effects.effect import Effect, Place, Shape, per_joint
from acqd.models.effects.scene import Scene
from acqd.models.greybox.model import direction


class CoulombFriction(Effect):
    """Dry friction."""

    id = "coulomb_friction"
    by_torque = True
    summary = "dry friction of a gear or bearing is higher (or lower) than the model has it"
    equation = "tau = F sign(qd)"
    neighbours = ("viscous_friction", "load_dependent_friction", "stribeck_friction")
    experiment = "single-joint motions at three constant speeds, both directions: dry friction does not grow with speed"

    def at(self, scene: Scene, shape: Shape) -> Floats:
        """Per joint."""
        return scene.power_per_torque * direction(scene.qd)

    def places(self, scene: Scene) -> Iterator[Place]:
        """Places."""
        yield from per_joint(scene.axes, "torque", "Nm", scene.model.group("coulomb"))


class ViscousFriction(Effect):
    """Friction in proportion to speed."""

    id = "viscous_friction"
    by_torque = True
    summary = "friction that grows with speed is higher (or lower): another grease, another temperature"
    equation = "tau = D qd"
    neighbours = ("thermal_friction", "coulomb_friction", "copper_loss")
    experiment = "the same motion at three speeds, without load, once cold and once after half an hour of work"

    def at(self, scene: Scene, shape: Shape) -> Floats:
        """Per joint."""
        return scene.power_per_torque * scene.qd

    def places(self, scene: Scene) -> Iterator[Place]:
        """Places."""
        yield from per_joint(scene.axes, "coefficient", "Nm s/rad", scene.model.group("viscous"))


class StribeckFriction(Effect):
    """More friction near standstill."""

    id = "stribeck_friction"
    by_torque = True
    summary = "extra friction near standstill that dies out with speed"
    equation = "tau = F exp(-(qd / v)^2) sign(qd)"
    neighbours = ("coulomb_friction", "clock_offset")
    experiment = "slow single-joint reversals at 1, 2, 5 and 10 % of the speed limit"
    shapes = ({"speed_rad_s": 0.05}, {"speed_rad_s": 0.1}, {"speed_rad_s": 0.2}, {"speed_rad_s": 0.4})
    bounds: ClassVar = {"speed_rad_s": (0.02, 1.0)}

    def at(self, scene: Scene, shape: Shape) -> Floats:
        """Per joint."""
        return scene.power_per_torque * direction(scene.qd) * np.exp(-((scene.qd / shape["speed_rad_s"]) ** 2))

    def places(self, scene: Scene) -> Iterator[Place]:
        """Places."""
        yield from per_joint(scene.axes, "torque", "Nm", np.ones(scene.axes))


class LoadDependentFriction(Effect):
    """Friction in proportion to the transmitted torque."""

    id = "load_dependent_friction"
    by_torque = True
    summary = "gear friction grows with the torque that the gear transmits"
    equation = "tau = k |tau_load| sign(qd)"
    neighbours = ("mechanical_power", "coulomb_friction", "copper_loss")
    experiment = "the same motion with and without a known payload, up and down"

    def at(self, scene: Scene, shape: Shape) -> Floats:
        """Per joint."""
        return scene.power_per_torque * direction(scene.qd) * np.abs(scene.tau_rigid)

    def places(self, scene: Scene) -> Iterator[Place]:
        """Places."""
        yield from per_joint(scene.axes, "share of the load", "-", np.ones(scene.axes))


class ThermalFriction(Effect):
    """Viscous friction that goes away as gears warm up."""

    id = "thermal_friction"
    by_torque = True
    summary = "friction of cold gears that falls while the arm works"
    equation = "tau = D exp(-t_moving / T) qd"
    neighbours = ("viscous_friction",)
    experiment = "the same motion every five minutes from a cold start, with gear temperatures if the robot logs them"
    shapes = ({"minutes": 4.0}, {"minutes": 8.0}, {"minutes": 16.0}, {"minutes": 32.0})
    bounds: ClassVar = {"minutes": (2.0, 90.0)}

    def at(self, scene: Scene, shape: Shape) -> Floats:
        """Per joint, by the time since the first recording: how long the arm worked between is not known."""
        age_s = np.maximum(scene.t - scene.memory.get("origin_s", -np.inf), 0.0)
        return np.asarray(scene.power_per_torque * scene.qd * np.exp(-age_s / (60 * shape["minutes"]))[:, None])

    def places(self, scene: Scene) -> Iterator[Place]:
        """Places."""
        yield from per_joint(scene.axes, "cold coefficient", "Nm s/rad", scene.model.group("viscous"))


class MechanicalPower(Effect):
    """A share of the mechanical power more, or less."""

    id = "mechanical_power"
    summary = "a share of the mechanical power is lost in the gears, or the model lacks mechanical power"
    equation = "P = a sum(|tau qd|) + b sum(tau qd)"
    neighbours = ("load_dependent_friction", "viscous_friction", "meter_gain")
    experiment = "lift and lower a known payload at two speeds: losses have one sign, mechanical power two"

    def at(self, scene: Scene, shape: Shape) -> Floats:
        """|tau qd| per joint as a torque, with the copper loss that goes with it; tau qd; |tau qd| alone."""
        lost = scene.power_per_torque * np.abs(scene.tau) * direction(scene.qd)
        return np.column_stack([lost, scene.tau * scene.qd, np.abs(scene.tau * scene.qd)])

    def places(self, scene: Scene) -> Iterator[Place]:
        """Places, losses and net power apart."""
        yield from per_joint(scene.axes, "lost share", "-", np.ones(scene.axes))
        yield from per_joint(scene.axes, "share", "-", np.ones(scene.axes), scene.axes)
        yield from per_joint(scene.axes, "share lost beside the motor", "-", np.ones(scene.axes), 2 * scene.axes)


class GearRipple(Effect):
    """Torque periodic in the gear's angle."""

    id = "gear_ripple"
    by_torque = True
    summary = "torque that comes and goes with the angle of one joint: an eccentric wave generator, a worn tooth"
    equation = "tau = A sin(n q) + B cos(n q)"
    neighbours = ("gravity_bias",)
    experiment = "slow constant-speed turns of the joint over its whole range"
    structural = False

    def at(self, scene: Scene, shape: Shape) -> Floats:
        """Sine and cosine, once the residual has told the joint (from 1) and the periods a turn."""
        if not shape:
            return np.zeros((len(scene.q), 0))
        joint = int(shape["joint"]) - 1
        angle, power_per_torque = shape["periods_per_turn"] * scene.q[:, joint], scene.power_per_torque[:, joint]
        return np.column_stack([power_per_torque * np.sin(angle), power_per_torque * np.cos(angle)])

    def places(self, scene: Scene) -> Iterator[Place]:
        """None beforehand."""
        return iter(())
