"""The virtual robot controller: it turns programs into joint motion and signals at 1 kHz."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats
from acqd.motion.chain import Chain, Move, plan_chain
from acqd.robot.description import RobotDescription

RATE = 1000
"""Samples per second of motion and plant."""


@dataclass(frozen=True, slots=True)
class Wait:
    """Program step: stand still."""

    seconds: float


@dataclass(frozen=True, slots=True)
class SwitchTool:
    """Program step: close (`on`) or open the gripper and wait `seconds` until it has moved."""

    on: bool
    seconds: float = 0.4


@dataclass(frozen=True, slots=True)
class Phase:
    """Program step: name the steps that follow. Some effects act only in phases of certain names."""

    name: str


Step: TypeAlias = Move | Wait | SwitchTool | Phase


@dataclass(frozen=True, slots=True)
class BrakeSettings:
    """Timing of the holding brakes."""

    release_s: float = 0.25
    """From the command to open until the arm may move."""
    close_after_s: float = 10.0
    """Standstill after which the brakes close."""


@dataclass(frozen=True, slots=True)
class Motion:
    """Motion and signals of the arm at 1 kHz."""

    q: Floats
    """[T, axes] rad."""
    qd: Floats
    """[T, axes] rad/s."""
    qdd: Floats
    """[T, axes] rad/s^2."""
    brake_open: NDArray[np.bool_]
    """[T]."""
    tool_on: NDArray[np.bool_]
    """[T]."""
    phase: list[str]
    """Names of the program's phases."""
    phase_number: NDArray[np.int16]
    """[T] index into `phase`."""

    def __len__(self) -> int:
        return len(self.q)

    @property
    def seconds(self) -> float:
        """Duration."""
        return len(self) / RATE

    def part(self, first: int, last: int) -> Motion:
        """Samples from `first` up to, but not including, `last`."""
        part = slice(first, last)
        return replace(
            self,
            q=self.q[part],
            qd=self.qd[part],
            qdd=self.qdd[part],
            brake_open=self.brake_open[part],
            tool_on=self.tool_on[part],
            phase_number=self.phase_number[part],
        )


class Controller:
    """Executes programs one after the other; the state of position, brakes and tool carries over."""

    def __init__(self, robot: RobotDescription, position: Floats, brakes: BrakeSettings | None = None) -> None:
        self.robot = robot
        self.position = position.copy()
        self._brakes = brakes or BrakeSettings()
        self._open = False
        self._tool = False
        self._standstill = self._brakes.close_after_s

    def run(self, program: list[Step]) -> Motion:
        """Motion of a whole program, from its first to its last step. The brakes close during long waits."""
        pieces: list[_Piece] = []
        phases = [""]
        number = 0
        moves: list[Move] = []
        for step in [*program, None]:
            if isinstance(step, Move):
                moves.append(step)
                continue
            if moves:
                pieces += self._execute(moves, number)
                moves = []
            if isinstance(step, Phase):
                if step.name not in phases:
                    phases.append(step.name)
                number = phases.index(step.name)
            elif isinstance(step, SwitchTool):
                self._tool = step.on
                pieces.append(self._stand(step.seconds, number))
            elif isinstance(step, Wait):
                pieces.append(self._stand(step.seconds, number))
        return _join(pieces, phases, self.robot.axes)

    def _execute(self, moves: list[Move], phase: int) -> list[_Piece]:
        pieces = []
        chain = plan_chain(self.position, moves, self.robot.speed, self.robot.acceleration)
        if not chain.legs:
            return []
        if not self._open:
            self._open, self._standstill = True, 0.0
            pieces.append(self._stand(self._brakes.release_s, phase))
        samples = int(np.ceil(chain.duration * RATE))
        pieces.append(_Piece(*chain.sample(np.arange(samples) / RATE), np.ones(samples, bool), self._tool, phase))
        self.position = end_of(chain)
        self._standstill = 0.0
        return pieces

    def _stand(self, seconds: float, phase: int) -> _Piece:
        samples = round(seconds * RATE)
        q = np.tile(self.position, (samples, 1))
        still = self._standstill + np.arange(1, samples + 1) / RATE
        self._standstill += seconds
        brake_open = np.full(samples, self._open) & (still <= self._brakes.close_after_s)
        self._open = self._open and self._standstill <= self._brakes.close_after_s
        return _Piece(q, np.zeros_like(q), np.zeros_like(q), brake_open, self._tool, phase)


@dataclass(frozen=True, slots=True)
class _Piece:
    q: Floats
    qd: Floats
    qdd: Floats
    brake_open: NDArray[np.bool_]
    tool_on: bool
    phase: int


def end_of(chain: Chain) -> Floats:
    """Final position of a chain, [axes] rad."""
    end: Floats = chain.origin + sum(leg.distance for leg in chain.legs)
    return end


def _join(pieces: list[_Piece], phases: list[str], axes: int) -> Motion:
    lengths = [len(piece.q) for piece in pieces]

    def concatenated(name: str) -> Floats:
        return np.concatenate([np.empty((0, axes)), *(getattr(piece, name) for piece in pieces)])

    return Motion(
        concatenated("q"),
        concatenated("qd"),
        concatenated("qdd"),
        np.concatenate([np.empty(0, bool), *(piece.brake_open for piece in pieces)]),
        np.repeat(np.array([piece.tool_on for piece in pieces], bool), lengths),
        phases,
        np.repeat(np.array([piece.phase for piece in pieces], np.int16), lengths),
    )
