"""Program files of the laboratory (TOML): point-to-point motions with speeds, pauses, and a tool that switches.

robot = "ur10e"
start = [0, -90, 90, -90, -90, 0]      # deg; of prismatic joints m

[[step]]
to = [30, -80, 100, -110, -90, 0]      # speed and acceleration are shares of the robot's limits
speed = 0.4
acceleration = 0.2
blend_after = 0.8                      # path parameter from which the next motion may begin; 1: none

[[step]]
wait = 2.5                             # s

[[step]]
tool = true                            # close the tool and wait
wait = 0.4

[[step]]
phase = "insert"                       # a name for the steps that follow
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field, model_validator

from acqd.arrays import Floats
from acqd.errors import InputError
from acqd.motion.chain import Move
from acqd.motion.controller import Controller, Motion, Phase, Step, SwitchTool, Wait
from acqd.robot.description import RobotDescription
from acqd.robot.section import Section, read_toml

_Share = Annotated[float, Field(gt=0, le=1)]
_Seconds = Annotated[float, Field(ge=0, le=3600)]


class StepSection(Section):
    """One step."""

    to: list[float] | None = None
    speed: _Share | None = None
    acceleration: _Share | None = None
    blend_after: _Share | None = None
    wait: _Seconds | None = None
    tool: bool | None = None
    phase: str | None = None

    @model_validator(mode="after")
    def _one_kind(self) -> StepSection:
        kinds = [self.to is not None, self.tool is not None or self.wait is not None, self.phase is not None]
        if sum(kinds) != 1:
            raise ValueError("a step has either to, or wait, or tool (with wait), or phase")
        if self.to is None and any(each is not None for each in (self.speed, self.acceleration, self.blend_after)):
            raise ValueError("speed, acceleration and blend_after belong to a step with to")
        return self


class ProgramSection(Section):
    """A whole program."""

    robot: str
    start: list[float]
    step: Annotated[list[StepSection], Field(min_length=1)]


@dataclass(frozen=True, slots=True)
class Program:
    """A program, and where it begins."""

    start: Floats
    """[axes] rad."""
    steps: tuple[Step, ...]

    def motion(self, robot: RobotDescription) -> Motion:
        """As the controller executes the program."""
        return Controller(robot, self.start).run(list(self.steps))


_SPEED, _ACCELERATION, _TOOL_S = 0.4, 0.2, 0.4
"""Of steps that say nothing."""


def read_program(path: Path, robot: RobotDescription) -> Program:
    """Read a program and check it against the robot's axes and limits. Raises InputError."""
    content = read_toml(path, ProgramSection)
    if content.robot != robot.name:
        raise InputError(path, f"is a program of {content.robot}, not of {robot.name}")
    start = _position(path, robot, content.start, "start")
    steps = tuple(_step(path, robot, each, f"step {k + 1}") for k, each in enumerate(content.step))
    return Program(start, steps)


def _step(path: Path, robot: RobotDescription, section: StepSection, where: str) -> Step:
    if section.to is not None:
        return Move(
            _position(path, robot, section.to, where),
            section.speed or _SPEED,
            section.acceleration or _ACCELERATION,
            section.blend_after or 1.0,
        )
    if section.phase is not None:
        return Phase(section.phase)
    if section.tool is not None:
        return SwitchTool(section.tool, _TOOL_S if section.wait is None else section.wait)
    return Wait(section.wait or 0.0)


def _position(path: Path, robot: RobotDescription, values: list[float], where: str) -> Floats:
    if len(values) != robot.axes:
        raise InputError(path, f"{where}: has {len(values)} numbers, but {robot.name} has {robot.axes} axes")
    q = np.array([joint.si(value) for joint, value in zip(robot.joint, values, strict=True)])
    beyond = np.flatnonzero((q < robot.lower - 1e-9) | (q > robot.upper + 1e-9) | ~np.isfinite(q))
    if len(beyond):
        axis = int(beyond[0])
        joint = robot.joint[axis]
        raise InputError(
            path,
            f"{where}: {joint.name} = {values[axis]:g} {_unit(robot, axis)} is outside {joint.limits[0]:g} .. "
            f"{joint.limits[1]:g} {_unit(robot, axis)} of {robot.name}",
        )
    return q


def _unit(robot: RobotDescription, axis: int) -> str:
    return "m" if robot.joint[axis].slides else "deg"


def program_text(program: Program, robot: RobotDescription, comment: str) -> str:
    """A program file."""

    def position(q: Floats) -> str:
        shown = [value if joint.slides else np.degrees(value) for joint, value in zip(robot.joint, q, strict=True)]
        return ", ".join(f"{value:.6f}" for value in shown)

    lines = [f"# {comment}", f'robot = "{robot.name}"', f"start = [{position(program.start)}]"]
    for step in program.steps:
        lines += ["", "[[step]]"]
        if isinstance(step, Move):
            lines += [f"to = [{position(step.target)}]", f"speed = {step.relative_speed:.6f}"]
            lines += [f"acceleration = {step.relative_acceleration:.6f}", f"blend_after = {step.blend_after:.6f}"]
        elif isinstance(step, SwitchTool):
            lines += [f"tool = {str(step.on).lower()}", f"wait = {step.seconds:.3f}"]
        elif isinstance(step, Wait):
            lines.append(f"wait = {step.seconds:.3f}")
        else:
            lines.append(f'phase = "{step.name}"')
    return "\n".join([*lines, ""])
