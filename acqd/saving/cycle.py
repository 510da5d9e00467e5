"""A motion as pauses and stretches between them, and motions that are put together from such pieces again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats
from acqd.motion.controller import RATE, Motion
from acqd.numerics import runs_of_true

_MOVING_RAD_S = 2e-3
_SHORTEST_S = 0.1
"""A shorter standstill is a corner of the path, not a pause."""
_TAIL_S, _TAIL_RAD_S, _TAIL_RAD_S2 = 0.08, 2e-4, 0.02
"""A stretch begins and ends where speed and acceleration have gone, at most so much later than it stops to move."""
_ASIDE_S = 0.1
"""A tool that switches so shortly before or after a pause switches in that pause."""
RELEASE_S = 0.25
"""From the command to open the brakes until the arm may move."""


@dataclass(frozen=True, slots=True)
class Rest:
    """A pause."""

    position: Floats
    """[axes] rad."""
    seconds: float
    brake_open: NDArray[np.bool_]
    """[T] as recorded."""
    tool_on: NDArray[np.bool_]
    """[T] as recorded."""
    process: bool
    """Whether something happens in the pause, so that it has to last as long as it does."""
    outer: bool
    """Before the first motion or after the last one."""

    @property
    def free(self) -> bool:
        """Whether the pause may be shorter or longer."""
        return not (self.process or self.outer)

    def lasting(self, seconds: float, brakes_after: float | None) -> Motion:
        """The pause with another duration; the brakes close after `brakes_after` s, or earlier as they did.

        They close only where the pause leaves the time to open them again.
        """
        brake_open = self._brakes(seconds, brakes_after)
        rows = len(brake_open)
        still = np.zeros((rows, len(self.position)))
        row = np.minimum(np.arange(rows), len(self.tool_on) - 1)
        return Motion(
            np.tile(self.position, (rows, 1)), still, still, brake_open, self.tool_on[row], [""],
            np.zeros(rows, np.int16),
        )  # fmt: skip

    def closed_s(self, seconds: float, brakes_after: float | None) -> float:
        """How much longer the brakes are closed in a pause of so many seconds than they were, s."""
        if brakes_after is None:
            return 0.0
        return max(int((~self._brakes(seconds, brakes_after)).sum()) - int((~self.brake_open).sum()), 0) / RATE

    def _brakes(self, seconds: float, brakes_after: float | None) -> NDArray[np.bool_]:
        """[T] open or closed."""
        rows = round(seconds * RATE)
        earlier = None if self.brake_open.all() else int(np.argmin(self.brake_open)) / RATE
        after = min((each for each in (earlier, brakes_after) if each is not None), default=None)
        if rows == len(self.brake_open) and (self.outer or after == earlier):
            return self.brake_open
        brake_open = np.ones(rows, bool)
        if self.outer:  # as it was, a row more or less at its end
            brake_open[:] = self.brake_open[np.minimum(np.arange(rows), len(self.brake_open) - 1)]
        elif after is not None:
            brake_open[round(after * RATE) : max(rows - round(RELEASE_S * RATE), 0)] = False
        return brake_open


@dataclass(frozen=True, slots=True)
class Stretch:
    """Motion between two pauses."""

    motion: Motion
    fixed: bool
    """The recording begins or ends within this stretch: nobody knows where the motion comes from, or goes."""

    @property
    def seconds(self) -> float:
        """Duration."""
        return self.motion.seconds


def pieces_of(motion: Motion) -> list[Rest | Stretch]:
    """Pauses and stretches in turn."""
    moving = np.abs(motion.qd).max(axis=1) > _MOVING_RAD_S
    still = np.zeros(len(moving), bool)
    for first, end in runs_of_true(~moving):
        if end - first >= _SHORTEST_S * RATE or first == 0 or end == len(moving):
            still[first:end] = True
    pieces: list[Rest | Stretch] = []
    still &= ~_tails(motion, still)
    edges = [0, *(np.flatnonzero(np.diff(still.astype(np.int8))) + 1).tolist(), len(still)]
    for first, end in pairwise(edges):
        if first == end:
            continue
        outer = first == 0 or end == len(still)
        pieces.append(_rest(motion, first, end, outer) if still[first] else Stretch(motion.part(first, end), outer))
    return pieces


def _tails(motion: Motion, still: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """[T] rows of pauses that belong to the stretches beside them: without them the acceleration would jump."""
    tails = np.zeros(len(still), bool)
    gone = (np.abs(motion.qd).max(axis=1) < _TAIL_RAD_S) & (np.abs(motion.qdd).max(axis=1) < _TAIL_RAD_S2)
    for first, end in runs_of_true(still):
        most = min(round(_TAIL_S * RATE), (end - first) // 3)
        quiet = np.flatnonzero(gone[first : first + most])
        tails[first : first + (int(quiet[0]) if len(quiet) else most)] = first > 0
        quiet = np.flatnonzero(gone[end - most : end])
        tails[end - most + (int(quiet[-1]) + 1 if len(quiet) else 0) : end] = end < len(still)
    return tails


def _rest(motion: Motion, first: int, end: int, outer: bool) -> Rest:
    aside = round(_ASIDE_S * RATE)
    near = motion.tool_on[max(first - aside, 0) : end + aside]
    return Rest(
        motion.q[first:end].mean(axis=0), (end - first) / RATE, motion.brake_open[first:end], motion.tool_on[first:end],
        bool(near.any() and not near.all()), outer,
    )  # fmt: skip


def joined(parts: Sequence[Motion]) -> Motion:
    """Motions one after another, as one phase."""
    whole = {
        name: np.concatenate([getattr(part, name) for part in parts])
        for name in ("q", "qd", "qdd", "brake_open", "tool_on")
    }
    return Motion(**whole, phase=[""], phase_number=np.zeros(len(whole["q"]), np.int16))


def continuous(parts: Sequence[Motion]) -> list[Motion]:
    """Motions whose pauses drift from the end of the stretch before to the beginning of the stretch after."""
    out = list(parts)
    for k, part in enumerate(parts):
        if part.qd.any() or not len(part):
            continue
        start = parts[k - 1].q[-1] if k else parts[k + 1].q[0] if k + 1 < len(parts) else part.q[0]
        end = parts[k + 1].q[0] if k + 1 < len(parts) else start
        share = np.linspace(0.0, 1.0, len(part))[:, None]
        out[k] = replace(part, q=start + share * (end - start))
    return out
