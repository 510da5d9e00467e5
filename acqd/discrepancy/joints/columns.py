"""Joint torques as columns: measured, of the base model, and of effects; per row, as means over the substeps."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acqd.arrays import Floats
from acqd.models.effects.effect import Effect
from acqd.models.effects.places import Shape
from acqd.models.effects.scene import Scene
from acqd.models.effects.substeps import averaged
from acqd.models.greybox.parameters import Layout, prior
from acqd.models.segments import Segment
from acqd.residual.logged_torque import Side, logged
from acqd.robot.description import RobotDescription
from acqd.robot.inertia import inertial_parameters
from acqd.robot.newton_euler import regressor


def measured_torque(segment: Segment, side: Side, robot: RobotDescription) -> Floats:
    """[T, axes] Nm: logged, or motor current times the nominal torque constant at the output."""
    values = logged(segment, side)
    assert values is not None
    constant = [joint.drive.effort_per_ampere for joint in robot.joint]
    return values if side == "link" else np.asarray(values * np.array(constant))


_ZERO_SHARE = 0.05
"""Standard deviation of a sensor's zero, relative to the joint's greatest torque."""
_LOAD_SHARE = 0.2
"""Standard deviation of load-dependent friction, relative to the load."""


@dataclass(frozen=True, slots=True)
class BaseLayout:
    """Indices of the base model's parameters: inertial, zero of every sensor, and on the motor side friction."""

    axes: int
    side: Side

    @property
    def size(self) -> int:
        """Number of parameters."""
        return (11 if self.side == "link" else 15) * self.axes

    def part(self, group: str) -> slice:
        """inertial, offset; on the motor side also coulomb, viscous, rotor and load (load-dependent friction)."""
        first = 10 * self.axes
        if group == "inertial":
            return slice(0, first)
        number = ("offset", "coulomb", "viscous", "rotor", "load").index(group)
        return slice(first + number * self.axes, first + (number + 1) * self.axes)

    @property
    def of_a_session(self) -> slice:
        """Parameters that differ from session to session: zeros, and friction (temperature, grease)."""
        return slice(10 * self.axes, (11 if self.side == "link" else 13) * self.axes)

    def prior(self, robot: RobotDescription) -> tuple[Floats, Floats]:
        """Mean and standard deviation [size], from the description; wide where the description says nothing."""
        layout = Layout(self.axes, ())
        belief = prior(layout, robot, inertial_parameters(robot), 0.0, 1.0)  # neither standby nor lag is a torque
        mean, deviation = np.zeros(self.size), np.zeros(self.size)
        deviation[self.part("offset")] = _ZERO_SHARE * robot.effort
        groups = ["inertial"]
        if self.side == "motor":
            groups += ["coulomb", "viscous", "rotor"]
            deviation[self.part("load")] = _LOAD_SHARE
        for group in groups:
            mean[self.part(group)] = belief.mean[layout.part(group)]
            deviation[self.part(group)] = belief.deviation[layout.part(group)]
        return mean, deviation


def base_columns(scene: Scene, layout: BaseLayout, inertial: Floats) -> Floats:
    """[T, axes, size] Nm per unit; `inertial` [10 axes]: whose torque load-dependent friction follows."""
    Y = averaged(regressor(scene.model.chain, scene.q, scene.qd, scene.qdd))
    X = np.zeros((scene.rows, scene.axes, layout.size))
    X[:, :, layout.part("inertial")] = Y
    own = np.arange(scene.axes)
    X[:, own, layout.part("offset").start + own] = 1.0
    if layout.side == "motor":
        forward = averaged(scene.direction)
        X[:, own, layout.part("coulomb").start + own] = forward
        X[:, own, layout.part("viscous").start + own] = averaged(scene.qd)
        X[:, own, layout.part("rotor").start + own] = averaged(scene.qdd)
        X[:, own, layout.part("load").start + own] = forward * np.abs(Y @ inertial)
    return X


def effect_columns(effect: Effect, scene: Scene, shape: Shape | None) -> Floats:
    """[T, axes, k] Nm per unit of each parameter; `shape` None: of all shapes side by side."""
    joints = []
    for joint in range(scene.axes):
        alone = scene.unit_torque(joint)
        memory = dict(scene.memory)
        columns = effect.columns(alone) if shape is None else effect.at(alone, shape)
        scene.memory.clear()
        scene.memory.update(memory)
        joints.append(averaged(columns))
    scene.moved.clear()  # as large as the columns of many effects
    return np.stack(joints, axis=1)
