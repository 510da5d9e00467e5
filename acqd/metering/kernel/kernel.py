"""Windows of a stream metered by `window.c`."""

from __future__ import annotations

import ctypes
import math
from dataclasses import dataclass

import numpy as np

from acqd.arrays import Floats
from acqd.metering import frequency
from acqd.metering.block import StreamFormat
from acqd.metering.frequency import FrequencyEstimator
from acqd.metering.held import HeldFrequency
from acqd.metering.kernel.compiled import usable_library, why_not
from acqd.metering.kernel.layout import (
    FLAGS,
    I_IM,
    I_RE,
    NO_TRIAL,
    PER_PHASE,
    PHASES,
    RAW_F,
    U_IM,
    U_RE,
    F,
    Form,
    State,
)
from acqd.metering.middle import SPAN, MiddleFrequency
from acqd.metering.stream import Piece
from acqd.metering.trial import Trial, make_trial

__all__ = ["Kernel", "Metered", "why_not"]
_MOST_TRIALS = 256  # 5 Hz of wander; 16 MB at 1200 samples
_PADDING = np.zeros(8)  # the kernel reads whole vectors


@dataclass(frozen=True, slots=True)
class Metered:
    """Quantities of consecutive windows."""

    rows: Floats
    """[rows, windows] as in `layout`."""

    @property
    def f(self) -> Floats:
        """[windows] Hz."""
        return np.asarray(self.rows[F])

    def of_phases(self, row: int) -> Floats:
        """[phases, windows] of one of the rows of a phase."""
        return self.rows[PHASES + row :: PER_PHASE]

    def reactive(self) -> Floats:
        """[phases, windows] of the fundamentals [var]."""
        if self.rows.shape[1] == 1:  # live: without the price of arrays
            one = self.rows[:, 0].tolist()
            phases = range(PHASES, len(one), PER_PHASE)
            return np.array([[(one[p + U_IM] * one[p + I_RE] - one[p + U_RE] * one[p + I_IM]) / 2] for p in phases])
        U_re, U_im, I_re, I_im = (self.of_phases(row) for row in (U_RE, U_IM, I_RE, I_IM))
        return (U_im * I_re - U_re * I_im) / 2

    def marks(self) -> list[int]:
        """[windows] bits 0 to 3: phases without mains; bits 4 to 7: phases over range."""
        return [int(mark) for mark in self.rows[FLAGS].tolist()]


class Kernel:
    """Meters the usual windows; shares its state with the objects of the numpy path."""

    def __init__(
        self,
        form: StreamFormat,
        fixed: bool,
        cycles: int,
        dead: Floats,
        estimator: FrequencyEstimator,
        held: HeldFrequency,
        middle: MiddleFrequency,
        library: ctypes.CDLL | None = None,
    ) -> None:
        """`dead` [phases] V; the others are the meter's. Raises RuntimeError where there is no library."""
        found = library or usable_library(len(form.scale))
        if found is None:
            raise RuntimeError("no library")
        self._windows = found.acqd_windows
        self._dtype = form.dtype
        self._volts = form.scale[0::2]  # per digit
        self._u_scale = np.asarray(self._volts)[:, None, None]
        self._estimator, self._held, self._middle = estimator, held, middle
        self._trials: dict[int, Floats] = {}
        self._first = int(frequency.to_grid(frequency.F_MIN - frequency.MARGIN)) - 1
        last = int(frequency.to_grid(frequency.F_MAX + frequency.MARGIN)) + 1
        self._table = np.zeros(last - self._first + 1, dtype=np.uintp)
        self._form = _form(form, fixed, cycles, dead, estimator, middle.oldest, self._first)
        self._state = State()
        self._pointers = ctypes.addressof(self._form), ctypes.addressof(self._state), self._table.ctypes.data
        self._rows = PHASES + PER_PHASE * form.phases
        self._mine = False  # the state is here, and not in the objects

    def meter(self, piece: Piece, first: int) -> Metered | None:
        """Windows of `piece` from number `first` on, as far as they are usual; None where the first is not."""
        if piece.codes.dtype != self._dtype or (not self._mine and not self._take_state()):
            return None
        samples = np.ascontiguousarray(piece.codes)
        count = len(piece.seq) - first
        rows = np.empty((self._rows, count))
        codes, bounds, out = samples.ctypes.data, piece.bounds.ctypes.data + 8 * first, rows.ctypes.data
        before = bytes(self._state)
        done = self._windows(*self._pointers, codes, bounds, count, piece.begin, out)
        while not done and self._state.reason == NO_TRIAL:
            self._add(self._state.point)
            done = self._windows(*self._pointers, codes, bounds, count, piece.begin, out)
        if not done:
            return None
        rows = rows[:, :done]
        usable = self._held.note_steady(rows[RAW_F].tolist(), self._magnitudes(rows))
        if usable < done:  # as if the first of the others had not been metered
            ctypes.memmove(self._pointers[1], before, len(before))
            rows = np.empty((self._rows, usable))
            self._windows(*self._pointers, codes, bounds, usable, piece.begin, rows.ctypes.data)
        return Metered(rows[:, :usable]) if usable else None

    def _magnitudes(self, rows: Floats) -> list[float]:
        """Of the fundamental of all phases together [digits], as `Estimate.magnitude`."""
        if rows.shape[1] == 1:
            one = rows[:, 0].tolist()
            phases = zip(range(PHASES, len(one), PER_PHASE), self._volts, strict=True)
            return [math.sqrt(sum([(one[p + U_RE] ** 2 + one[p + U_IM] ** 2) / u**2 for p, u in phases]))]
        fundamentals = rows[PHASES:].reshape(-1, PER_PHASE, rows.shape[1])[:, U_RE : U_IM + 1] / self._u_scale
        magnitudes: list[float] = np.sqrt(np.einsum("pcw,pcw->w", fundamentals, fundamentals)).tolist()
        return magnitudes

    def give_back(self) -> None:
        """Put the state into the objects of the numpy path, which meters the next window."""
        if self._mine:
            state, known = self._state, self._state.known
            self._estimator.trial = state.trial
            self._held.last = state.last
            self._middle.f, self._middle.at = np.array(state.f[:known]), np.array(state.at[:known])
            self._mine = False

    def _take_state(self) -> bool:
        state, middle = self._state, self._middle
        if self._estimator.trial is None or not self._held.calm:
            return False
        state.trial, state.last, state.known = self._estimator.trial, self._held.last, len(middle.f)
        for k in range(min(len(middle.f), SPAN)):
            state.f[k], state.at[k] = middle.f[k], middle.at[k]
        self._mine = True
        return True

    def _add(self, point: int) -> None:
        if len(self._trials) >= _MOST_TRIALS:
            self._trials.clear()
            self._table[:] = 0
        packed = _packed(make_trial(point * frequency.GRID, self._form.rate, self._form.fit), len(self._volts))
        self._trials[point] = packed
        self._table[point - self._first] = packed.ctypes.data


def _packed(trial: Trial, phases: int) -> Floats:
    """Vectors in the order of `WEIGHT` in C, edges in rising order, and which edge is which."""
    columns = np.concatenate((trial.projection, trial.turn))
    edges = np.minimum(trial.edges.ravel(), trial.turn.shape[1])
    order = np.argsort(edges, kind="stable")
    return np.concatenate((columns.ravel(order="F" if phases > 2 else "C"), edges[order], order, _PADDING))


def _form(
    form: StreamFormat, fixed: bool, cycles: int, dead: Floats, estimator: FrequencyEstimator, oldest: float, first: int
) -> Form:
    result = Form(
        bits=form.bits,
        fit=estimator.samples,
        fixed=fixed,
        first_point=first,
        rate=form.rate,
        cycles=cycles,
        grid=frequency.GRID,
        slack=frequency.SLACK,
        f_low=frequency.F_MIN - 0.5,
        f_high=frequency.F_MAX + 0.5,
        trial_low=frequency.F_MIN - frequency.MARGIN,
        trial_high=frequency.F_MAX + frequency.MARGIN,
        purity=frequency.MIN_PURITY,
        steady=estimator.steady,
        oldest=oldest,
        code_max=form.code_max,
        code_min=form.code_min,
    )
    result.scale[: len(form.scale)] = form.scale
    result.dead[: form.phases] = dead.ravel().tolist()
    result.bend[:] = frequency.BEND.ravel().tolist()
    return result
