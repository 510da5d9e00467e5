"""What `acqd save` is asked about: a model, and the motion of a log or a program of the same robot."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from acqd.errors import InputError, UserError
from acqd.models.bundle.bundle import Bundle
from acqd.models.bundle.envelope import Envelope
from acqd.models.bundle.reference import load_reference
from acqd.models.bundle.restore import open_model
from acqd.motion.controller import Motion
from acqd.motion.limits import MotionLimits, greatest_jerk
from acqd.motion.profile import SMOOTHING_S
from acqd.motion.program_file import Program, read_program
from acqd.motion.replayed_log import motion_of
from acqd.robot.arm import Arm
from acqd.robot.collision import CollisionChecker
from acqd.robot.description import RobotDescription, load_description
from acqd.robot.log_reader import read_log
from acqd.robot.scene import load_scene
from acqd.saving.doubt import Doubt
from acqd.saving.order import require_free_order
from acqd.saving.power import Meter

_STILL = 1e-3
"""rad or m: a joint that covers less has not moved."""


@dataclass(frozen=True, slots=True)
class Asked:
    """What the engineer asked for."""

    longer: float = 0.1
    """Share by which the cycle may last longer."""
    seconds: float | None = None
    """A cycle time instead of that share, s."""
    scene: str = "free"
    workspace: tuple[float, ...] | None = None
    """x, y, z from, x, y, z to, m, of the flange."""
    share_of_speed: float = 1.0
    brakes_after: float = 2.0
    """s of standstill after which brakes may close."""
    least_rest: float = 0.5
    """s that stay of every pause: something settles, or somebody looks."""
    keep_waits: bool = False
    payload_kg: float | None = None
    """Change of the mass at the flange."""
    free_order: bool = False
    """Whether the points of a program may be visited in any order."""
    robot: str | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Subject:
    """A motion, its robot and the model."""

    path: Path
    bundle: Bundle
    model_path: Path
    meter: Meter
    doubt: Doubt | None
    arm: Arm
    motion: Motion
    program: Program | None
    """None for a log."""
    limits: MotionLimits
    beyond: float
    """Share of the rows outside of what the model has learned from."""

    @property
    def simulated(self) -> bool:
        """Whether the model has learned from simulated power."""
        return bool(self.bundle.metadata.get("measured") == "simulated")


def opened(model_path: Path, path: Path, asked: Asked) -> Subject:
    """Read everything. Raises UserError, InputError in one line."""
    bundle, model = open_model(model_path)
    meter = Meter(model, model_path)
    robot = load_description(asked.robot or bundle.metadata["description"])
    if robot.name != bundle.metadata["robot"] or robot.axes != model.axes:
        raise UserError(
            f"{model_path}: is a model of {bundle.metadata['robot']}, not of {robot.name}: use its own model"
        )
    if not any(joint.capsules for joint in robot.joint):
        raise UserError(
            f"{robot.name}: the description has no capsules, so that collisions cannot be excluded; "
            "add capsules to the links (docs/robots.md)"
        )
    program = read_program(path, robot) if path.suffix == ".toml" else None
    if asked.free_order:
        require_free_order(program, path)
    motion = _logged(path, robot) if program is None else program.motion(robot)
    if not len(motion) or np.ptp(motion.q, axis=0).max() < _STILL:
        raise UserError(f"{path}: the arm does not move: there is nothing to save by another motion")
    arm = Arm(robot)
    limits = _limits(arm, CollisionChecker(arm, load_scene(asked.scene)), motion, bundle, asked)
    broken = limits.broken(motion)
    if broken is not None:
        raise UserError(
            f"{path}: {robot.name} cannot execute this within its limits ({broken}); is it this robot's, and are "
            "--scene, --workspace and --limit-speed right?"
        )
    beyond = Envelope.from_json(bundle.metadata["envelope"]).outside(
        motion.q[:: round(model.step_s * 1000)], model.step_s
    )
    return Subject(
        path, bundle, model_path, meter, Doubt.of(model, load_reference(model_path)), arm, motion, program, limits,
        float(beyond.mean()),
    )  # fmt: skip


def _logged(path: Path, robot: RobotDescription) -> Motion:
    log = read_log(path, robot)
    if log.q.shape[1] != robot.axes:
        raise InputError(path, f"has {log.q.shape[1]} axes, {robot.name} has {robot.axes}")
    return motion_of(log, robot)


def _limits(arm: Arm, checker: CollisionChecker, motion: Motion, bundle: Bundle, asked: Asked) -> MotionLimits:
    """Limits of the robot, and of what the model knows.

    No motion that the model has never met, and none that this log has not: acceleration and jerk of a log that exceeds
    the described ones, which are often guessed, are the log's own.
    """
    robot, known = arm.description, Envelope.from_json(bundle.metadata["envelope"])
    own_speed, own_acceleration = np.abs(motion.qd).max(axis=0), np.abs(motion.qdd).max(axis=0)
    met = [np.maximum(np.abs(known.low[k]), np.abs(known.high[k])) for k in range(3)]
    speed = np.minimum(asked.share_of_speed * robot.speed, np.maximum(met[1], own_speed))
    acceleration = np.maximum(np.minimum(robot.acceleration, met[2]), own_acceleration)
    return MotionLimits(
        arm,
        checker,
        speed,
        acceleration,
        asked.workspace,
        np.maximum(robot.acceleration / SMOOTHING_S, greatest_jerk(motion)),
    )
