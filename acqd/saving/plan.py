"""Another timing of the same pieces: how long each of them lasts, and by which law."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from acqd.errors import UserError
from acqd.motion.controller import Motion
from acqd.motion.program_file import Program
from acqd.saving.cycle import Rest
from acqd.saving.doubt import BLOCK_S
from acqd.saving.power import Meter
from acqd.saving.sharing import Curve, shared

UNIFORM = "uniform"
"""Law of plain slowing."""


@dataclass(frozen=True, slots=True)
class Change:
    """What a proposal may change."""

    law: str = ""
    """Kind of law of the stretches; empty: they stay as they are."""
    waits: bool = False
    """Pauses may give time to motion, and take time from it."""
    brakes_after: float | None = None
    """s of standstill after which the brakes close."""


class Timing(ABC):
    """A stretch that may last longer or shorter."""

    seconds: float
    """Duration as it is."""
    laws: tuple[str, ...]
    """Kinds of laws besides uniform slowing, the best one last."""

    @abstractmethod
    def curve(self, law: str) -> Curve:
        """Energy of the drives against duration, of a kind of law."""

    @abstractmethod
    def unlike(self, law: str, seconds: float) -> float:
        """How unlike the stretch as it is a law with a duration is: 1 at speeds that are another by a factor of e.

        The square of the logarithm of the ratio of speeds, on average over the stretch. Nobody knows that errors of its
        slower and of its faster parts cancel.
        """


Piece = Rest | Timing


class Cycle(ABC):
    """Pauses and stretches in turn. Whatever is neither a pause nor can change its timing is left out of `pieces`."""

    pieces: Sequence[Piece]
    meter: Meter
    least_rest: float
    seconds: float
    """Duration as it is."""
    strange_s: float = 0.0
    """As `unlike_s`, of what is elsewhere than it was, whatever the timing."""

    @abstractmethod
    def timed(self, change: Change, durations: Sequence[float]) -> tuple[Motion, Program | None]:
        """The whole cycle with other durations of the pieces, s, and the program that moves so, where there is one."""

    @property
    def laws(self) -> tuple[str, ...]:
        """Kinds of laws of the stretches, the best one last."""
        return next((each.laws for each in self.pieces if isinstance(each, Timing)), ())

    def slack(self, piece: Rest) -> float:
        """What a pause can give, s."""
        return max(piece.seconds - self.least_rest, 0.0) if piece.free else 0.0

    def durations(self, change: Change, total_s: float) -> list[float]:
        """Of every piece, s. Raises UserError where the cycle cannot be so fast."""
        more_s = total_s - self.seconds
        if change.law == UNIFORM:
            return self._slowed(change, more_s)
        curves = []
        for piece in self.pieces:
            if isinstance(piece, Timing):
                curves.append(piece.curve(change.law) if change.law else _as_it_is(piece.seconds))
            elif change.waits and piece.free:
                power = 0.0 if change.brakes_after is not None else float(self.meter.holding(piece.position[None])[0])
                curves.append(Curve.pause(piece.seconds - self.slack(piece), power))
            else:
                curves.append(_as_it_is(piece.seconds))
        in_pieces = sum(piece.seconds for piece in self.pieces)
        return shared(curves, in_pieces + more_s, self.seconds - in_pieces)

    def _slowed(self, change: Change, more_s: float) -> list[float]:
        """All stretches by one factor; pauses give what they can."""
        give = [self.slack(each) if isinstance(each, Rest) and change.waits else 0.0 for each in self.pieces]
        moving = sum(each.seconds for each in self.pieces if isinstance(each, Timing))
        factor = (moving + sum(give) + more_s) / moving
        if factor < 1 - 1e-9:
            raise UserError(f"slowing makes no cycle of {self.seconds + more_s:.2f} s from one of {self.seconds:.2f} s")
        return [
            factor * piece.seconds if isinstance(piece, Timing) else piece.seconds - given
            for piece, given in zip(self.pieces, give, strict=True)
        ]

    def unlike_s(self, change: Change, durations: Sequence[float]) -> float:
        """Seconds of motion over which errors of the model as between strange motions would add up to the same.

        Along one path, an error changes with the speed: by itself over a factor of e, in proportion below. At rest it
        stays the same as long as the rest does; closed brakes end the error of the holding power.
        """
        total = self.strange_s
        for piece, seconds in zip(self.pieces, durations, strict=True):
            if isinstance(piece, Rest):
                total += at_rest(piece.seconds - seconds) + at_rest(piece.closed_s(seconds, change.brakes_after))
            elif change.law:
                total += (piece.seconds + seconds) * min(1.0, piece.unlike(change.law, seconds))
        return total


def at_rest(seconds: float) -> float:
    """`Cycle.unlike_s` of a rest at one posture."""
    return seconds**2 / BLOCK_S


def _as_it_is(seconds: float) -> Curve:
    return Curve(np.array([seconds]), np.zeros(1), np.zeros(1, int))
