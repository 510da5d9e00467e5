"""The use case of thesis chapter 9: the assembly of a fidget spinner, and its imitation by the digital twin."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from acqd.arrays import Floats
from acqd.errors import UserError
from acqd.motion.chain import Move
from acqd.motion.controller import Phase, Step, SwitchTool, Wait
from acqd.motion.excitation import TOOL_DOWN
from acqd.motion.program import Planner
from acqd.robot.arm import Arm
from acqd.robot.kinematics import Pose, inverse_kinematics

Controller = Literal["robot", "twin"]

_FEEDER, _FIXTURE, _TRAY = (0.50, -0.30), (0.58, 0.02), (0.45, 0.32)  # m, x and y on the table
_ABOVE, _DOWN = 0.36, 0.24  # m, height of the flange
_PARTS = 3  # bearings that are pressed into the body of the spinner


@dataclass(frozen=True, slots=True)
class Place:
    """A flange position (m) above the table with the tool down, turned about the vertical axis."""

    x: float
    y: float
    z: float
    turn_deg: float = 0.0

    def pose(self) -> Pose:
        """The place as a pose in the base frame."""
        angle = np.radians(self.turn_deg)
        about_z = np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
        return Pose(np.array([self.x, self.y, self.z]), about_z @ TOOL_DOWN)


class Assembly:
    """Assembly programs of one cell. The twin resolves the redundancy of the arm differently (thesis, Figure 9.3)."""

    def __init__(self, arm: Arm, planner: Planner, controller: Controller = "robot") -> None:
        self._arm = arm
        self._planner = planner
        self._random = np.random.default_rng(9 if controller == "robot" else 11)
        twin = controller == "twin"
        # the elbow points to the other side: axes 3 and 5 differ at the same flange pose
        self._seed = np.radians([0, 35, 25 if twin else -12, -80, 20 if twin else 8, 65, 0][: arm.axes])
        self._speed_factor = 0.97 if twin else 1.0
        self._settle_s = 0.12 if twin else 0.2

    def home(self) -> Floats:
        """Position at the start and the end of an assembly, [axes] rad. Raises UserError."""
        return self._reach(Place(0.5, 0.0, 0.45), self._seed)

    def program(self, random: np.random.Generator) -> list[Step]:
        """One assembly with small random variations of part positions and speeds. Raises UserError."""
        steps: list[Step] = [Phase("start"), Wait(1.2)]
        at = self.home()
        for number in range(_PARTS):
            jitter = random.normal(0, 0.004, 2)
            part = (_FEEDER[0] + 0.06 * number + jitter[0], _FEEDER[1] + jitter[1])
            seat = (_FIXTURE[0] + 0.035 * np.cos(2.1 * number), _FIXTURE[1] + 0.035 * np.sin(2.1 * number))
            at = self._pick(steps, at, part, random)
            at = self._insert(steps, at, seat, random)
        at = self._screw(steps, at, random)
        at = self._pick(steps, at, _FIXTURE, random, phase="pick up product")
        at = self._go(steps, at, [Place(*_TRAY, _ABOVE), Place(*_TRAY, _DOWN)], 0.4, random, phase="place")
        steps.append(SwitchTool(False))
        at = self._go(steps, at, [Place(*_TRAY, _ABOVE)], 0.4, random)
        steps += [Phase("home"), *self._moves(at, [self.home()], 0.45, random), Phase("idle"), Wait(2.0)]
        return steps

    def _pick(
        self,
        steps: list[Step],
        at: Floats,
        part: tuple[float, float],
        random: np.random.Generator,
        phase: str = "pick",
    ) -> Floats:
        at = self._go(steps, at, [Place(*part, _ABOVE), Place(*part, _DOWN)], 0.45, random, phase=phase)
        steps.append(SwitchTool(True))
        return self._go(steps, at, [Place(*part, _ABOVE)], 0.4, random, phase="carry")

    def _insert(self, steps: list[Step], at: Floats, seat: tuple[float, float], random: np.random.Generator) -> Floats:
        at = self._go(steps, at, [Place(*seat, _ABOVE), Place(*seat, _DOWN + 0.03)], 0.45, random)
        at = self._go(steps, at, [Place(*seat, _DOWN)], 0.12, random, phase="insert")
        steps += [Wait(self._settle_s), Phase("release"), SwitchTool(False)]
        return self._go(steps, at, [Place(*seat, _ABOVE)], 0.4, random, phase="retract")

    def _screw(self, steps: list[Step], at: Floats, random: np.random.Generator) -> Floats:
        """Screw in the cap: turn to and fro about the vertical axis."""
        at = self._go(steps, at, [Place(*_FIXTURE, _ABOVE), Place(*_FIXTURE, _DOWN + 0.02)], 0.4, random, phase="cap")
        for turn in (55.0, -55.0, 55.0, 0.0):
            at = self._go(steps, at, [Place(*_FIXTURE, _DOWN + 0.015, turn)], 0.35, random, phase="screw")
        return self._go(steps, at, [Place(*_FIXTURE, _ABOVE)], 0.4, random, phase="retract")

    def _go(
        self,
        steps: list[Step],
        at: Floats,
        places: list[Place],
        speed: float,
        random: np.random.Generator,
        phase: str | None = None,
    ) -> Floats:
        """Append blended motions through `places`; returns the configuration at the last one, [axes] rad."""
        if phase:
            steps.append(Phase(phase))
        targets: list[Floats] = []
        for place in places:
            targets.append(self._reach(place, targets[-1] if targets else at))
        steps += self._moves(at, targets, speed, random)
        return targets[-1]

    def _moves(self, at: Floats, targets: list[Floats], speed: float, random: np.random.Generator) -> list[Move]:
        moves: list[Move] = []
        for start, end in zip([at, *targets[:-1]], targets, strict=True):
            if np.abs(end - start).max() <= 1e-9:
                continue
            relative = float(speed * self._speed_factor * random.uniform(0.94, 1.06))
            moves.append(Move(end, relative, 0.2, self._planner.blend_after(start, end, 0.2)))
        moves[-1] = replace(moves[-1], blend_after=1.0)  # the next motions are planned separately
        return self._planner.without_collisions(at, moves)

    def _reach(self, place: Place, near: Floats) -> Floats:
        q = inverse_kinematics(self._arm, place.pose(), near, self._random)
        if q is None:
            name = self._arm.description.name
            raise UserError(
                f"assembly: {name} cannot reach x {place.x:g}, y {place.y:g}, z {place.z:g} m with the tool down"
            )
        return q
