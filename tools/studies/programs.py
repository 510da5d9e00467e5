"""Checks programs of `acqd next` with MuJoCo: limits of joints and torques, the workspace, collisions.

    python -m tools.studies.programs [--programs 1000] [--minutes 3] [--robot iiwa7_r800 ...] [--seed 1] [--json]

A program is a sequence of pieces, each from home to home, that the designer chooses from. For every robot and drawn
situation (measured motion, share of speed, workspace, scene) the pieces are made as the designer makes them, and
programs of the given length are drawn from them at random, so that every piece is used whatever a loop would ask.
Positions, speeds, accelerations, torques and collisions are taken from the motion at 1 kHz by MuJoCo, which shares no
code with acqd's planner: collisions where the arm comes nearer than the margin of the scene. Ends with the number of
violations.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from dataclasses import dataclass

import numpy as np
import orjson
from rich.console import Console
from rich.progress import Progress
from rich.table import Table

from acqd.arrays import Floats
from acqd.errors import UserError
from acqd.experiment.pieces import Piece, motion_of, pieces_of
from acqd.experiment.space import Space
from acqd.models.segments import Segment
from acqd.motion.controller import Controller, Motion
from acqd.motion.excitation import Excitation
from acqd.motion.program import Planner
from acqd.robot.arm import Arm
from acqd.robot.collision import CollisionChecker
from acqd.robot.description import RobotDescription, load_description
from acqd.robot.scene import Scene, load_scene
from tools.common import mujoco_oracle

ROBOTS = ("iiwa7_r800", "ur10e", "ur3e", "kinova_gen3")
STEP_S = 0.04
_CHECK_ROWS = 10
"""Rows of 1 ms between two configurations whose clearance is measured: half of what the designer checks."""
_SLACK = 1 + 1e-6
_APART = 8
"""Rows of 1 ms between positions whose second difference is the mean acceleration between them: over less, rounding of
positions shows."""
_RECORDINGS = 3
_SITUATIONS = 5
"""Per robot."""


@dataclass(frozen=True, slots=True)
class Checked:
    """What MuJoCo says about one piece."""

    piece: Piece
    broken: tuple[str, ...]
    """Limits that the piece exceeds, in words."""
    clearance_m: float
    """Smallest distance of the arm to itself and to the boxes, less the margin of the scene."""


def options() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    add = parser.add_argument
    add("--programs", type=int, default=1000)
    add("--minutes", type=float, default=3.0)
    add("--robot", action="append", choices=ROBOTS, help=f"default {' '.join(ROBOTS)}")
    add("--seed", type=int, default=1)
    add("--json", action="store_true")
    return parser.parse_args()


def situation(robot: RobotDescription, random: np.random.Generator) -> tuple[Space, Scene]:
    """Measured motion of the thesis' kind in a scene, and where a designed motion may go."""
    scene = load_scene("digital_factory" if robot.name == "iiwa7_r800" and random.random() < 0.5 else "free")
    arm = Arm(robot)
    checker = CollisionChecker(arm, scene)
    planner = Planner(arm, checker)
    segments = []
    for number in range(_RECORDINGS):
        trajectory = Excitation(arm, checker, scene.name).all_space(f"t{number}", random)
        motion = Controller(robot, trajectory.waypoints[0]).run(planner.program(trajectory, random))
        q = motion.q[:: int(1000 * STEP_S)]
        segments.append(Segment(f"r{number}", f"t{number}", "all", "train", q, np.zeros(len(q)), None, {}))
    share = float(random.uniform(0.1, 1.0))
    return Space.of(arm, scene, segments, STEP_S, share, _workspace(arm, segments, random)), scene


def _workspace(arm: Arm, segments: list[Segment], random: np.random.Generator) -> tuple[float, ...] | None:
    """A box around half of the measured positions of the flange, in one situation of two."""
    if random.random() < 0.5:
        return None
    places, _ = mujoco_oracle.flange(mujoco_oracle.build(arm.description), np.concatenate([s.q for s in segments]))
    low, high = np.percentile(places, [15, 85], axis=0)
    return (*low, *high)


class Judge:
    """MuJoCo's view of one space."""

    def __init__(self, space: Space, scene: Scene) -> None:
        self._space, self._scene = space, scene
        self._model = mujoco_oracle.build(space.arm.description)

    def __call__(self, piece: Piece) -> Checked:
        """Check the piece as it is executed."""
        motion = motion_of(self._space, piece.steps)
        q = motion.q[::_CHECK_ROWS]
        clearance = mujoco_oracle.clearance(self._space.arm.description, self._scene, q) - self._scene.margin_m
        broken = [*self._limits(motion), *self._workspace(q)]
        if clearance < -1e-4:  # at the margin itself, rounding decides
            broken.append("collision")
        return Checked(piece, tuple(broken), clearance)

    def _limits(self, motion: Motion) -> list[str]:
        robot, space = self._space.arm.description, self._space
        q, step_s = motion.q, 1e-3
        speed = np.abs(np.diff(q, axis=0)).max(axis=0) / step_s
        bend = q[2 * _APART :] - 2 * q[_APART:-_APART] + q[: -2 * _APART]
        acceleration = np.abs(bend).max(axis=0) / (_APART * step_s) ** 2
        rows = slice(None, None, 2 * _CHECK_ROWS)
        torque = mujoco_oracle.inverse_dynamics(self._model, q[rows], motion.qd[rows], motion.qdd[rows])
        kept = {
            "position": ((q >= robot.lower - 1e-9) & (q <= robot.upper + 1e-9)).all(axis=0),
            "speed": speed <= space.speed * _SLACK + 1e-9,
            "acceleration": acceleration <= space.acceleration * _SLACK + 1e-6,
            "torque": np.abs(torque).max(axis=0) <= robot.effort * _SLACK,
            "rest at both ends": np.abs(q[[0, -1]] - space.home).max(axis=0) < 1e-6,
        }
        return [f"{what} of joint {axis + 1}" for what, good in kept.items() for axis in np.flatnonzero(~good)]

    def _workspace(self, q: Floats) -> list[str]:
        box = self._space.workspace
        if box is None:
            return []
        places, _ = mujoco_oracle.flange(self._model, q)
        return (
            [] if ((places >= np.array(box[:3]) - 1e-6) & (places <= np.array(box[3:]) + 1e-6)).all() else ["workspace"]
        )


def drawn(pieces: list[Checked], total_s: float, random: np.random.Generator) -> list[Checked]:
    """A program: pieces in random order until none fits in what is left of the time."""
    program: list[Checked] = []
    left = total_s
    while fitting := [each for each in pieces if each.piece.seconds <= left]:
        program.append(fitting[random.integers(len(fitting))])
        left -= program[-1].piece.seconds
    return program


def studied(name: str, programs: int, total_s: float, seed: int, progress: Progress) -> list[dict[str, object]]:
    """A row per situation of one robot."""
    rows = []
    task = progress.add_task(name, total=None)
    for number in range(_SITUATIONS):
        random = np.random.default_rng([seed, ROBOTS.index(name), number])
        try:
            space, scene = situation(load_description(name), random)
        except UserError as error:
            rows.append({"robot": name, "situation": number + 1, "refused": str(error)})
            continue
        judge = Judge(space, scene)
        made = pieces_of(space, int(random.integers(1000)))
        progress.update(task, total=_SITUATIONS * len(made))
        pieces = []
        for piece in made:
            pieces.append(judge(piece))
            progress.advance(task)
        wanted = [drawn(pieces, total_s, random) for _ in range(programs // _SITUATIONS)]
        made_programs = [program for program in wanted if program]
        broken = Counter(what for program in made_programs for what in {w for each in program for w in each.broken})
        rows.append({
            "robot": name, "situation": number + 1, "scene": scene.name, "workspace": space.workspace is not None,
            "pieces": len(pieces), "programs": len(made_programs),
            "minutes": sum(each.piece.seconds for program in made_programs for each in program) / 60,
            "violating": sum(any(each.broken for each in program) for program in made_programs),
            "broken": dict(broken), "least_clearance_m": min((each.clearance_m for each in pieces), default=None),
        })  # fmt: skip
    return rows


def main() -> None:
    """Print the table; exit with 1 where a program exceeds a limit."""
    given = options()
    robots = given.robot or list(ROBOTS)
    console = Console(stderr=True)
    rows = []
    with Progress(console=console, transient=True) as progress:
        for name in robots:
            rows += studied(name, -(-given.programs // len(robots)), 60 * given.minutes, given.seed, progress)
    if given.json:
        print(orjson.dumps({"simulated": True, "situations": rows}, option=orjson.OPT_SERIALIZE_NUMPY).decode())
    else:
        table = Table("robot", "scene", "workspace", "pieces", "programs", "minutes", "violating", "beyond margin [mm]")
        for row in rows:
            if "refused" in row:
                table.add_row(str(row["robot"]), str(row["refused"]), *[""] * 6)
                continue
            nearest = row["least_clearance_m"]
            table.add_row(
                str(row["robot"]), str(row["scene"]), "a box" if row["workspace"] else "any", str(row["pieces"]),
                str(row["programs"]), f"{row['minutes']:.0f}", f"{row['violating']} {row['broken'] or ''}",
                "" if nearest is None else f"{1000 * nearest:.1f}",  # type: ignore[operator]
            )  # fmt: skip
        Console().print(table)
    sys.exit(any(row.get("violating") for row in rows))


if __name__ == "__main__":
    main()
