"""The choice of pieces: the piece that is worth most per second, until the time is up, then exchanges that improve.

Information of different pieces adds, as that of independent recordings does. A repeat brings other noise, and the same
errors of the model: what the learning rate leaves out (ADR 106). Greedy choice with exchanges is the usual way to
exact designs (Fedorov 1972; Mitchell 1974).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from acqd.discrepancy.regression.least_squares import Moments
from acqd.experiment.contest import Contest, together

Worth = Callable[[Moments], float]
_ALL_AGAIN, _NEARLY_BEST = 4, 16
"""What a piece adds changes slowly while a program grows (Minoux 1978): all pieces are looked at after every fourth,
and in between those that were best, unless none of these adds anything."""


def after(so_far: Moments, pieces: Mapping[str, Moments], program: Sequence[str], learning_rate: float) -> Moments:
    """What the recordings so far and a program say."""
    repeats = Counter(program)
    return together([so_far, *(pieces[name].times(_told(count, learning_rate)) for name, count in repeats.items())])


def chosen(
    worth: Worth, so_far: Moments, pieces: Mapping[str, Moments], seconds: Mapping[str, float], total_s: float,
    learning_rate: float,
) -> list[str]:  # fmt: skip
    """Names of pieces of at most `total_s` together, in the order of their choice; a piece may be repeated.

    `learning_rate`: share of the information of rows that can be believed.
    """

    def with_one_more(program: Sequence[str], names: Sequence[str]) -> dict[str, float]:
        state, repeats = after(so_far, pieces, program, learning_rate), Counter(program)
        more = {name: _told(repeats[name] + 1, learning_rate) - _told(repeats[name], learning_rate) for name in names}
        return {name: worth(together([state, pieces[name].times(more[name])])) for name in names}

    program: list[str] = []
    gains: dict[str, float] = {}
    left = total_s
    while fitting := [name for name in pieces if seconds[name] <= left]:
        now = worth(after(so_far, pieces, program, learning_rate))
        shortlist = fitting if len(program) % _ALL_AGAIN == 0 else _best_of(gains, fitting)
        for looked_at in (shortlist, fitting):
            found = {name: (own - now) / seconds[name] for name, own in with_one_more(program, looked_at).items()}
            gains |= found
            best = max(found, key=lambda name: found[name])
            if found[best] > 0 or len(looked_at) == len(fitting):
                break
        if found[best] <= 0:
            break
        program.append(best)
        left -= seconds[best]
    nearly = list(dict.fromkeys([*program, *_best_of(gains, list(pieces))]))
    for place, now_there in enumerate(program):  # exchanges
        others = [name for k, name in enumerate(program) if k != place]
        left = total_s - sum(seconds[name] for name in others)
        found = with_one_more(others, [name for name in nearly if seconds[name] <= left])
        program[place] = max(found, key=lambda name: (found[name], name == now_there))
    return program


def dealt(program: Sequence[str], seconds: Mapping[str, float], parts: int) -> list[str]:
    """The pieces of a program, the best first, in an order that gives some of the best to each of its equal parts.

    The loop holds one part out: there, the cause has to show, too.
    """
    hands: list[list[str]] = [[] for _ in range(parts)]
    for name in program:
        min(hands, key=lambda own: sum(seconds[each] for each in own)).append(name)
    return [name for own in hands for name in own]


def _told(repeats: int, learning_rate: float) -> float:
    """What repeats of a piece tell, in pieces: more of them average noise, but not the errors of the model.

    Of the variance of a size by one piece, noise is the share `learning_rate`, and the model's errors are the rest.
    """
    return repeats / (learning_rate + repeats * (1 - learning_rate)) if repeats else 0.0


def _best_of(gains: Mapping[str, float], names: Sequence[str]) -> list[str]:
    """The pieces that gained most per second when they were last looked at."""
    return sorted(names, key=lambda name: -gains.get(name, 0.0))[:_NEARLY_BEST]


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
