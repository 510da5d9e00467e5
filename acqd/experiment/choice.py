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
_ALL_AGAIN, _NEARLY_BEST = 4, 16
"""What a piece adds changes slowly while a program grows (Minoux 1978): all pieces are looked at after every fourth,
and in between those that were best, unless none of these adds anything."""


def chosen(
    worth: Worth, so_far: Moments, pieces: Mapping[str, Moments], seconds: Mapping[str, float], total_s: float
) -> list[str]:
    """Names of pieces of at most `total_s` together, in the order of their choice; a piece may be repeated."""
    program: list[str] = []
    gains: dict[str, float] = {}
    state, left = so_far, total_s
    while fitting := [name for name in pieces if seconds[name] <= left]:
        now = worth(state)
        shortlist = fitting if len(program) % _ALL_AGAIN == 0 else _best_of(gains, fitting)
        for looked_at in (shortlist, fitting):
            found = {name: (worth(together([state, pieces[name]])) - now) / seconds[name] for name in looked_at}
            gains |= found
            best = max(found, key=lambda name: found[name])
            if found[best] > 0 or len(looked_at) == len(fitting):
                break
        if found[best] <= 0:
            break
        program.append(best)
        state, left = together([state, pieces[best]]), left - seconds[best]
    nearly = list(dict.fromkeys([*program, *_best_of(gains, list(pieces))]))
    for place in range(len(program)):
        program[place] = _exchanged(
            worth, so_far, {name: pieces[name] for name in nearly}, seconds, total_s, program, place
        )
    return program


def _best_of(gains: Mapping[str, float], names: Sequence[str]) -> list[str]:
    """The pieces that gained most per second when they were last looked at."""
    return sorted(names, key=lambda name: -gains.get(name, 0.0))[:_NEARLY_BEST]


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
