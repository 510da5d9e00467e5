"""The choice of pieces: the piece that is worth most per second, until the time is up, then exchanges that improve.

Information of pieces adds, as that of independent recordings does, so that a program is a set of pieces with repeats.
Greedy choice with exchanges is the usual way to exact designs (Fedorov 1972; Mitchell 1974).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from acqd.discrepancy.regression.least_squares import Moments
from acqd.experiment.contest import Contest, together

Worth = Callable[[Moments], float]


def chosen(
    worth: Worth, so_far: Moments, pieces: Mapping[str, Moments], seconds: Mapping[str, float], total_s: float
) -> list[str]:
    """Names of pieces of at most `total_s` together, in the order of their choice; a piece may be repeated."""
    program: list[str] = []
    state, left = so_far, total_s
    while fitting := [name for name in pieces if seconds[name] <= left]:
        now = worth(state)
        gains = {name: (worth(together([state, pieces[name]])) - now) / seconds[name] for name in fitting}
        best = max(gains, key=lambda name: gains[name])
        if gains[best] <= 0:
            break
        program.append(best)
        state, left = together([state, pieces[best]]), left - seconds[best]
    for place in range(len(program)):
        program[place] = _exchanged(worth, so_far, pieces, seconds, total_s, program, place)
    return program


def _exchanged(
    worth: Worth, so_far: Moments, pieces: Mapping[str, Moments], seconds: Mapping[str, float], total_s: float,
    program: Sequence[str], place: int,
) -> str:  # fmt: skip
    """The best piece at a place of a program, all others kept."""
    others = [name for k, name in enumerate(program) if k != place]
    left = total_s - sum(seconds[name] for name in others)
    rest = together([so_far, *(pieces[name] for name in others)])
    fitting = [name for name in pieces if seconds[name] <= left]
    return max(fitting, key=lambda name: (worth(together([rest, pieces[name]])), name == program[place]))


def filled(names: Sequence[str], seconds: Mapping[str, float], total_s: float) -> list[str]:
    """Pieces in turn, as many as the time has room for."""
    program: list[str] = []
    left = total_s
    while names:
        before = len(program)
        for name in names:
            if seconds[name] <= left:
                program.append(name)
                left -= seconds[name]
        if len(program) == before:
            break
    return program


def d_optimal(contest: Contest) -> Worth:
    """What a design of identification is worth: the log determinant of the model's own parameters."""

    def worth(moments: Moments) -> float:
        normal = moments.normal + np.diag(contest.precision + 1e-9 * np.maximum(np.diag(moments.normal), 1e-9))
        return float(np.linalg.slogdet(normal)[1])

    return worth
