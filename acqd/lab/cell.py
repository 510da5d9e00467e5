"""A virtual cell: the robot as described, the robot as it really is, its scene and its plant."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acqd.errors import UserError
from acqd.lab.effects import check_axes
from acqd.lab.plant.parameters import PlantParameters, load_plant, true_robot
from acqd.lab.settings import LabSettings
from acqd.motion.excitation import Cube, Excitation
from acqd.motion.program import Planner
from acqd.robot.arm import Arm
from acqd.robot.collision import CollisionChecker
from acqd.robot.description import RobotDescription, load_description
from acqd.robot.scene import Scene, load_scene

_CUBES = {
    "iiwa7_r800": Cube(),
    "ur3e": Cube((0.3, 0.1, 0.22), 0.16),
    "ur10e": Cube((0.6, 0.1, 0.3), 0.3),
    "kinova_gen3": Cube((0.45, 0.0, 0.3), 0.25),
}
# first numbers of the independent random streams of a cell
TRUE_ROBOT, MAINS, MOTION, RECORDER, EFFECTS, ORDER, CLOCK, STANDBY = range(1, 9)


@dataclass(frozen=True, slots=True)
class Cell:
    """One virtual robot and its surroundings."""

    settings: LabSettings
    number: int
    """From 0; the true robots of a fleet deviate differently from the description."""
    robot: RobotDescription
    scene: Scene
    arm: Arm
    """As described; motions are planned with it."""
    true_arm: Arm
    """As it really is; the plant moves it."""
    parameters: PlantParameters
    planner: Planner

    @property
    def checker(self) -> CollisionChecker:
        """Collision checker of the described arm in its scene."""
        return self.planner.checker

    @property
    def device(self) -> str:
        """Device name in power rows."""
        return device_name(self.settings, self.number)

    def cube(self) -> Cube:
        """The volume of limited-space trajectories. Raises UserError for a robot without one."""
        if self.settings.cube is not None:
            return self.settings.cube.cube()
        if self.robot.name not in _CUBES:
            raise UserError(f"robot {self.robot.name} has no default cube; give one (--cube X Y Z EDGE)")
        return _CUBES[self.robot.name]

    def excitation(self, *, thesis: bool = False) -> Excitation:
        """Generator of source trajectories."""
        return Excitation(self.arm, self.checker, self.scene.name, thesis)

    def random(self, *stream: int) -> np.random.Generator:
        """Reproducible random numbers of this cell, independent for each `stream`."""
        return self.settings.random(self.number, *stream)


def device_name(settings: LabSettings, number: int) -> str:
    """Device name of cell `number` (from 0)."""
    return f"{settings.device}-{number + 1:02d}"


def build_cell(settings: LabSettings, number: int = 0) -> Cell:
    """Load description, scene and plant of cell `number`. Raises UserError or InputError."""
    robot = load_description(settings.robot)
    if robot.sliding:
        raise UserError(
            f"robot {robot.name}: joint {robot.joint[robot.sliding[0]].name} is prismatic, and the laboratory moves "
            "revolute joints only; choose another --robot"
        )
    scene = load_scene(settings.scene or ("digital_factory" if robot.name == "iiwa7_r800" else "free"))
    parameters = load_plant(robot, settings.plant)
    check_axes(settings.effects, robot.axes)
    arm = Arm(robot)
    truth = true_robot(robot, parameters.parameter_spread, settings.robot_random(number, TRUE_ROBOT))
    planner = Planner(arm, CollisionChecker(arm, scene), settings.motion.parameters())
    return Cell(settings, number, robot, scene, arm, Arm(truth), parameters, planner)
