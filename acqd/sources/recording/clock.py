"""Sampling rate and start of a recording from the times of its samples."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from acqd.arrays import Floats
from acqd.errors import InputError
from acqd.sources.waveform import LATEST_NS, ChannelMap
from acqd.timestamps import SINCE_1970_S

_JITTER = 0.01  # of one period: a larger deviation is not an equidistant recording
_COARSE = 1e-4  # resolution of the times over their span: beyond it they do not tell the rate
_EARLIEST_S = 946_684_800.0  # 2000-01-01: a time column before it counts from something else than 1970
_DAY_S = 86_400.0
_UNIX = ((1e17, 1e-9), (1e14, 1e-6), (1e11, 1e-3))
"""Numbers from which on a Unix time without a unit is in ns, us, ms, and s per number: in s they lie beyond 5000."""
_PAUSE = 1.5  # steps between two rows, from which on samples are missing there
_ROWS = 50  # rows per pause, at least: what pauses more often is no waveform


@dataclass(frozen=True, slots=True)
class Clock:
    """When the samples were taken."""

    rate: float | None
    start_utc_ns: int | None
    notes: tuple[str, ...] = ()
    breaks: tuple[tuple[int, int], ...] = ()
    """Sample before which samples are missing, and how many."""


def unix_s(number: float) -> float:
    """Seconds per unit of a time without a unit, by its size."""
    return next((factor for least, factor in _UNIX if abs(number) > least), 1.0)


def of_times(path: Path, times: Floats, quantum: float, given: ChannelMap, first_row: int) -> Clock:
    """Of a column of times [s], printed in steps of `quantum`. Raises InputError where it is not equidistant."""
    if not len(times):
        return Clock(None, None)
    if np.abs(times).max() >= LATEST_NS / 1e9:
        raise InputError(
            path,
            f"its time column reaches {np.abs(times).max():g} s; expected seconds before 2200: say its unit in the "
            "header, like time [ms]",
        )
    start, notes = _start_of(float(times[0]))
    step = float(np.median(np.diff(times))) if len(times) > 1 else 0.0
    span = float(times[-1] - times[0])
    mean = span / max(len(times) - 1, 1)
    even = len(times) > 1 and float(np.ptp(np.diff(times))) < _JITTER * abs(step)
    if len(times) > 3 and not given.rate and _in_pairs(times):
        raise InputError(
            path,
            "each of its times stands twice, as in an envelope (minimum and maximum); save samples, in sample or "
            "high-resolution mode",
        )
    steady = not even and _steady(times, step, quantum)
    coarse = not even and quantum > 0.3 * mean > 0 and not steady
    if span <= 0 or (coarse and quantum > _COARSE * span):
        if given.rate:
            return Clock(mean and 1 / mean if span > 0 and quantum <= 0.02 * span else None, start, notes)
        why = "does not advance" if span <= 0 else "is printed too coarsely to tell the rate, or is not equidistant"
        raise InputError(path, f"its time column {why}; give the sampling rate with --rate")
    # The whole span tells the step best, unless something is missing in it.
    period = mean if coarse or (abs(mean - step) < _JITTER * abs(step) + quantum and not steady) else step
    if given.rate:
        return Clock(1 / period if period > 0 else None, start, notes)
    slack = max(_JITTER * period, 1.01 * quantum, 2 * np.spacing(abs(times[-1])), 1.1e-6 if start else 0.0)
    expected = times[0] + period * np.arange(len(times))
    uneven = np.flatnonzero(np.abs(times - expected) > slack + 0.5 * abs(period) * _JITTER)
    if len(uneven) and not coarse and (pauses := _pauses(times, step, slack)):
        return Clock(pauses.rate, start, (*notes, *pauses.notes), pauses.breaks)
    if len(uneven):
        # From row to row: against the even grid, a missing row shifts all others.
        row = int(np.argmax(np.abs(np.diff(times) - step))) + 1
        raise InputError(
            path,
            f"row {row + first_row}: time {times[row]:.9g} s is {times[row] - times[row - 1]:.6g} s after the row "
            f"before, expected an equidistant step of {step:.6g} s; resample it, or give --rate to overrule the column",
        )
    return Clock(float(1 / period), start, notes)


def _steady(times: Floats, step: float, quantum: float) -> bool:
    """Whether times that are printed in steps as large as theirs are even but for pauses.

    Where several rows share a printed time, or rounding leaves a time out, steps are 0 or twice as long.
    """
    steps = np.diff(times)
    return bool(((np.abs(steps - step) < 0.5 * quantum) | (steps > 2.5 * step)).all()) and step > 0.5 * quantum


def _pauses(times: Floats, step: float, slack: float) -> Clock | None:
    """Of times that are equidistant but for some pauses: a logger that lost rows, or segments of a recorder."""
    steps = np.diff(times)
    at = np.flatnonzero(steps > _PAUSE * step) + 1
    if not at.size or at.size * _ROWS > len(times) or step <= 0 or steps.max() > SINCE_1970_S:
        return None
    edges = [0, *at.tolist(), len(times)]
    lengths = np.diff(edges)
    longest = int(np.argmax(lengths))
    begin, end = edges[longest], edges[longest + 1]
    period = float(times[end - 1] - times[begin]) / max(end - 1 - begin, 1)
    grid = np.concatenate([period * np.arange(n) for n in lengths])
    if np.abs(times - np.repeat(times[edges[:-1]], lengths) - grid).max() > slack + 0.5 * _JITTER * period:
        return None
    lost = np.maximum(np.rint(steps[at - 1] / period).astype(int) - 1, 1)
    row, missing_s = int(at[0]), float(steps[at[0] - 1])
    note = (
        f"its times pause {at.size} time{'s' if at.size > 1 else ''} (first before sample {row + 1}, for "
        f"{missing_s:.4g} s): gaps in the rows, unless its clock was set then"
    )
    return Clock(1 / period, None, (note,), tuple(zip(at.tolist(), lost.tolist(), strict=True)))


def _in_pairs(times: Floats) -> bool:
    """Whether times come in pairs of equal ones that follow each other evenly."""
    firsts, seconds = times[0 : len(times) // 2 * 2 : 2], times[1::2]
    steps = np.diff(firsts)
    return bool((firsts == seconds).all() and steps.min() > 0 and np.ptp(steps) < 0.5 * np.median(steps))


def _start_of(first: float) -> tuple[int | None, tuple[str, ...]]:
    """UTC [ns] of a time column that counts from 1970; another one has no date."""
    if abs(first) < SINCE_1970_S:
        return None, ()
    if _EARLIEST_S <= first <= time.time() + _DAY_S:
        return round(first * 1e9), ()
    return None, (
        f"its time column begins at {first:g}, which is no date between 2000 and today: it counts from something else "
        "(uptime? ms?), so rows start now or at --start",
    )
