"""Why the stamps of a log cannot be the times of its poses: what nobody can put right.

A recorder whose stamps count rows shows an even clock and, where a row is missing, a way twice as long. A clock that
was set goes on by a second while the arm moved on by a row. Two recorders in one file let the arm go to and fro.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats
from acqd.numerics import mad_sigma
from acqd.robot.ways import AROUND, FAST, FEWEST, Ways, ways_of

_TWICE = (0.6, 0.25)
"""Ways beyond the usual one of a step across a missing row, and of its neighbours."""
_FEWEST_STEPS, _MISSING_SHARE = 5, 0.004
"""Such steps, and their share of the rows in motion, from which on a line says so."""
_CALM = 0.1
"""Scatter of the ways up to which a way of two rows is known."""
_SET_ROWS, _SET_S = 5.0, 0.04
"""Usual steps, and s, by which the stamps go on while the arm covers the way of one row."""
_TO_AND_FRO, _TO_AND_FRO_SHARE = 2.5, 0.5
"""Way of two rows over their distance, and the share of the rows in motion, from which on the arm goes to and fro. The
noise of encoders goes twice as far."""


@dataclass(frozen=True, slots=True)
class ClockFault:
    """Why stamps cannot be those of the poses."""

    text: str
    row: int | None = None
    """Where; None: in the whole log."""
    missing_s: float = 0.0
    """Time of the rows in motion that are missing without a trace in the stamps."""
    refused: bool = True
    """No lag can be right."""


def clock_fault(
    time: Floats, q: Floats, speed: Floats, q_step: Floats, left_out: NDArray[np.bool_] | None = None
) -> ClockFault | None:
    """Why stamps [T] s, rising, cannot be those of the poses [T, axes], all different; None where they can.

    `left_out` [T - 1]: steps across which equal poses were left out.
    """
    ways = ways_of(time, q / speed, q_step / speed)
    if ways is None:
        return None
    fro = _to_and_fro(q / speed, ways.fast)
    if fro > _TO_AND_FRO_SHARE:
        return ClockFault(
            f"the arm goes to and fro from row to row in {100 * fro:.0f} % of the rows in motion: are rows of two "
            "recorders, or of two robots, in one file? Write one file for each"
        )
    if ways.judged.sum() < FEWEST:
        return None
    equal = np.diff(q, axis=0).any(axis=1) == 0
    skipped = equal if left_out is None else equal | left_out
    skipped = skipped | np.append(skipped[1:], False) | np.insert(skipped[:-1], 0, False)
    judged = ways.judged
    beyond = np.where(judged, ways.way - ways.step, 0.0)
    row = _set_clock(np.where(skipped, 0.0, beyond), ways)
    if row is not None:
        return ClockFault(
            f"the time goes on by {time[row + 1] - time[row]:.3g} s while the arm moves as in one row: if the clock "
            "was set there, cut the log at this row; all is well if the arm stopped and no rows were written",
            row + 1,
            refused=False,
        )
    missing = _missing(beyond, ways) - int((judged & (beyond < -_TWICE[0])).sum())
    missing -= 0 if left_out is None else int((judged & left_out).sum())  # written too late, and then too early
    share = missing / judged.sum()
    if missing < _FEWEST_STEPS or share < _MISSING_SHARE or mad_sigma(beyond[judged], 0.0) > _CALM:
        return None
    return ClockFault(
        f"across {missing} steps in motion ({100 * share:.1f} %) the arm goes as far as in two: if the times count "
        "rows, rows are missing there, and the lag grows by each; record the controller's own time",
        missing_s=missing * float(np.median(ways.step_s)),
        refused=False,  # a servo that reports its angle at its own pace does the same with true times
    )


def set_back(time: Floats, q: Floats, speed: Floats) -> int | None:
    """The row, in the order of the file, at which the time [T] s goes back while the arm [T, axes] moves on.

    A recorder that writes a block late, and a second recording in the file, go on with another pose.
    """
    steps = np.diff(time)
    back = np.flatnonzero(steps < 0)
    if len(back) != 1 or not AROUND <= back[0] < len(steps) - AROUND:
        return None
    row = int(back[0])
    ways = np.linalg.norm(np.diff(q[row - AROUND : row + AROUND + 2] / speed, axis=0), axis=1)
    usual, usual_s = float(np.median(ways)), float(np.median(np.abs(steps)))
    if -steps[row] < max(_SET_ROWS * usual_s, _SET_S):  # rows that came in another order
        return None
    if usual < FAST * usual_s or not 1 - _TWICE[0] < ways[AROUND] / usual < 1 + _TWICE[0]:
        return None
    return row + 1


def _missing(beyond: Floats, ways: Ways) -> int:
    """Steps across which the arm covers the way of two rows, and beside which it covers that of one, onwards.

    Stamps that count rows are even; where they are not, they tell of the rows that are missing. Beside a pose of
    another time the arm goes back.
    """
    judged = ways.judged
    uneven = np.pad(judged & ~(np.abs(ways.step - 1) < _TWICE[1]), AROUND)
    judged = judged & ~np.lib.stride_tricks.sliding_window_view(uneven, 2 * AROUND + 1).any(axis=1)
    alone = np.pad(np.abs(np.where(judged, beyond, 0.0)) < _TWICE[1], 1, constant_values=True)
    twice = judged & (np.abs(beyond - 1) < 1 - _TWICE[0]) & alone[:-2] & alone[2:] & (ways.three > 3)
    return int(twice.sum())


def _set_clock(beyond: Floats, ways: Ways) -> int | None:
    """The one step across which the stamps go on by rows, and the arm by one, and the next stamps do not make up.

    A recorder that writes only while the arm moves has several.
    """
    far = ways.judged & (-beyond > np.maximum(_SET_ROWS, _SET_S / ways.step_s)) & (ways.way < 2.0)
    places = np.flatnonzero(far)
    if len(places) != 1:
        return None
    row = int(places[0])
    around = float(beyond[max(row - 12, 0) : row + 13].sum() - beyond[row])
    return row if abs(around) < 0.2 * abs(beyond[row]) else None


def _to_and_fro(x: Floats, judged: NDArray[np.bool_]) -> float:
    """Share of the rows in motion at which the arm turns back: an arm that swings turns in two rows of a swing."""
    steps = np.linalg.norm(np.diff(x, axis=0), axis=1)
    way = steps[1:] + steps[:-1]
    distance = np.linalg.norm(x[2:] - x[:-2], axis=1)
    where = judged[1:] & judged[:-1]
    if not where.any():
        return 0.0
    return float((way[where] > _TO_AND_FRO * distance[where]).mean())
