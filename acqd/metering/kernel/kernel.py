"""Windows of a stream metered by `window.c`."""

from __future__ import annotations

import ctypes
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from acqd.arrays import Floats
from acqd.metering import frequency, packed, two_fits
from acqd.metering.block import Codes, StreamFormat
from acqd.metering.energy import EnergyRegister
from acqd.metering.frequency import FrequencyEstimator
from acqd.metering.held import HeldFrequency
from acqd.metering.kernel.compiled import usable_library, why_not
from acqd.metering.kernel.layout import (
    BEND,
    FIRST,
    FLAGS,
    LANES,
    MAGNITUDE,
    NO_TRIAL,
    QUANTITIES,
    UNSETTLED,
    F,
    Form,
    Live,
    State,
)
from acqd.metering.onset import Cycles
from acqd.metering.piece import Piece
from acqd.metering.trial import Trial

__all__ = ["Kernel", "Metered", "why_not"]
LiveMetered = tuple[float, int, list[float], list[float]]
"""Of one window: f [Hz], mark as in `Metered.marks`, VRMS to REACTIVE of `layout` of all phases each, and kWh: imported
of all phases, then exported. A tuple, for an object takes longer to make."""
_MOST_TRIALS = 256  # 5 Hz of wander; 16 MB at 1200 samples
_KEPT = ("trial", "last", "change", "apart", "known", "follows")
"""Fields of the state that one window leaves for the next."""
_LONGEST = 256  # samples of a piece, as in C


@dataclass(slots=True)
class Metered:
    """Quantities of consecutive windows."""

    rows: Floats
    """[rows, windows] as in `layout`."""
    phases: int
    doubted: bool = False
    """The f of the next window was looked at and is not usable: numpy meters that one."""

    @property
    def f(self) -> Floats:
        """[windows] Hz."""
        return np.asarray(self.rows[F])

    def of_phases(self, quantity: int) -> Floats:
        """[phases, windows] of one of the quantities of `layout`."""
        first = FIRST + quantity * self.phases
        return self.rows[first : first + self.phases]

    def marks(self) -> list[int]:
        """[windows] bits 0 to 3: phases without mains; bits 4 to 7: phases over range; UNSETTLED."""
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
        library: ctypes.CDLL | None = None,
    ) -> None:
        """`dead` [phases] V; the others are the meter's. Raises RuntimeError where there is no library."""
        found = library or usable_library(len(form.scale))
        if found is None:
            raise RuntimeError("no library")
        self._windows = found.acqd_windows
        self._window, self._quiet, self._undo = found.acqd_window, found.acqd_quiet, found.acqd_undo
        self._dtype, self._phases = form.dtype, form.phases
        self._estimator, self._held = estimator, held
        self._trials: dict[int, Floats] = {}
        self._first = int(frequency.to_grid(frequency.F_MIN - frequency.MARGIN)) - 1
        last = int(frequency.to_grid(frequency.F_MAX + frequency.MARGIN)) + 1
        self._table = np.zeros(last - self._first + 1, dtype=np.uintp)
        self._form = _form(form, fixed, cycles, dead, estimator, self._first)
        self._state = State()
        self._pointers = ctypes.addressof(self._form), ctypes.addressof(self._state), self._table.ctypes.data
        self._rows = FIRST + QUANTITIES * form.phases
        self._one = np.empty(self._rows)
        form_at, state_at, table_at = self._pointers
        self._live = Live(form=form_at, state=state_at, table=table_at, out=self._one.ctypes.data)
        self._live_at = ctypes.c_void_p(ctypes.addressof(self._live))
        self._buffer: Codes | None = None  # that `_live` has the address of
        self._fits = False  # the buffer is one of this stream: type of its codes, number of its channels
        self._mine = False  # the state is here, and not in the objects

    def meter(self, piece: Piece, first: int) -> Metered | None:
        """Windows of `piece` from number `first` on, as far as they are usual; None where the first is not."""
        if not self._of_stream(piece.codes) or (not self._mine and not self._take_state()):
            return None
        samples = np.ascontiguousarray(piece.codes)
        count = len(piece.seq) - first
        rows = np.empty((self._rows, count))
        codes, bounds, out = samples.ctypes.data, piece.bounds.ctypes.data + 8 * first, rows.ctypes.data
        before = bytes(self._state)
        done = self._windows(*self._pointers, codes, bounds, count, out)
        while not done and self._state.reason == NO_TRIAL:
            self._add(self._state.point)
            done = self._windows(*self._pointers, codes, bounds, count, out)
        if not done:
            return None
        rows = rows[:, :done]
        unsettled = self._held.note_steady(
            rows[F].tolist(), rows[MAGNITUDE].tolist(), [*map(Cycles, *rows[BEND:FIRST].tolist())]
        )
        usable = len(unsettled)
        if usable < done:  # as if the first of the others had not been metered
            ctypes.memmove(self._pointers[1], before, len(before))
            rows = np.empty((self._rows, usable))
            self._windows(*self._pointers, codes, bounds, usable, rows.ctypes.data)
        rows[FLAGS, :usable] += UNSETTLED * np.array(unsettled)
        return Metered(rows[:, :usable], self._phases, usable < done) if usable else None

    def meter_live(self, buffer: Codes, begin: int, end: int, energy: EnergyRegister) -> LiveMetered | None:
        """The window of samples begin .. end of a contiguous buffer; as `meter`.

        Adds to `energy`. Without the price of arrays: several times as fast.
        """
        if not self._point_at(buffer, begin, end) or (not self._mine and not self._take_state()):
            return None
        while not self._window(self._live_at):
            if self._state.reason != NO_TRIAL:
                return None
            self._add(self._state.point)
        f, mark, magnitude, bend, swell, kink, growth, *rest = self._one.tolist()  # rest: ENERGY, VRMS ... of `layout`
        held, phases = self._held, self._phases
        if not (
            held.note_calm(f, magnitude, kink, growth) or held.note(f, magnitude, Cycles(bend, swell, kink, growth))
        ):
            self._undo(self._live_at)
            return None
        marks = int(mark) | UNSETTLED if held.unsettled else int(mark)
        return f, marks, rest[phases:], energy.add_window(rest[:phases])

    def meter_quiet(self, buffer: Codes, begin: int, end: int, energy: EnergyRegister) -> LiveMetered | None:
        """As `meter_live`, for a window without mains that follows one: no f is searched. None for all others."""
        if self._mine or self._estimator.trial is not None or not self._point_at(buffer, begin, end):
            return None
        if not self._quiet(self._live_at):
            return None
        numbers, phases = self._one.tolist(), self._phases
        f, mark, rest = numbers[F], int(numbers[FLAGS]), numbers[FIRST:]
        return f, mark, rest[phases:], energy.add_window(rest[:phases])

    def _point_at(self, buffer: Codes, begin: int, end: int) -> bool:
        """Let the kernel read this window of this buffer; whether the buffer is one of this stream."""
        live = self._live
        if buffer is not self._buffer:
            self._buffer, live.codes, self._fits = buffer, buffer.ctypes.data, self._of_stream(buffer)
        live.begin, live.end = begin, end
        return self._fits

    def _of_stream(self, codes: Codes) -> bool:
        """Whether C, which checks nothing, may read them as codes of this stream."""
        return bool(codes.dtype == self._dtype and codes.shape[1] == 2 * self._phases)

    def state(self) -> packed.State | None:
        """What is known of the stream so far; None while the objects of the numpy path know it."""
        return {name: getattr(self._state, name) for name in _KEPT} if self._mine else None

    def restore(self, state: packed.State | None) -> None:
        """Go on where `state` was taken."""
        self._mine = state is not None
        for name, value in (state or {}).items():
            setattr(self._state, name, value)

    def give_back(self) -> None:
        """Put the state into the objects of the numpy path, which meters the next window."""
        if self._mine:
            state, fits = self._state, self._estimator.fits
            self._estimator.trial = state.trial
            self._held.last = state.last
            fits.change, fits.known = state.change, state.known
            fits.last, fits.follows = state.apart, bool(state.follows)
            self._mine = False

    def _take_state(self) -> bool:
        state, fits = self._state, self._estimator.fits
        if self._estimator.trial is None or not self._held.calm:
            return False
        state.trial, state.last = self._estimator.trial, self._held.last
        state.change, state.known = fits.change, fits.known
        state.apart, state.follows = fits.last, fits.follows
        self._mine = True
        return True

    def _add(self, point: int) -> None:
        if len(self._trials) >= _MOST_TRIALS:
            self._trials.clear()
            self._table[:] = 0
        packed = _packed(self._estimator.at(point))
        self._trials[point] = packed
        self._table[point - self._first] = packed.ctypes.data


def _packed(trial: Trial) -> Floats:
    """The vectors of a trial as `window.c` takes them: a table of the pieces, then their weights, aligned."""
    pieces = list(_pieces(trial))
    table = np.zeros(_padded(1 + sum(len(numbers) for _, numbers in pieces)))
    table[0] = len(pieces)
    table[1 : 1 + 5 * len(pieces)] = [number for _, numbers in pieces for number in numbers]
    stretch = np.concatenate((trial.projection[4:], trial.turn))
    weights = [table]
    for samples, (count, in_cycles, *_) in pieces:
        columns = stretch[:, samples]
        if in_cycles:
            columns = np.concatenate((columns, trial.projection[:4, samples]))
        weights.append(np.pad(columns, ((0, 0), (0, _padded(int(count)) - int(count)))).ravel())
    return _aligned(np.concatenate(weights))


def _pieces(trial: Trial) -> Iterator[tuple[slice, tuple[float, float, float, float, float]]]:
    """Samples of each piece, and its numbers in `window.c`."""
    samples = trial.turn.shape[1]
    edges = np.minimum(trial.edges.ravel(), samples).tolist()
    begin = 0
    for end, edge in sorted([*((end, number) for number, end in enumerate(edges)), (trial.first, -1), (samples, -1)]):
        stop = int(end)
        while stop - begin > _LONGEST:
            yield slice(begin, begin + _LONGEST), (_LONGEST, begin >= trial.first, -1, 0.0, 0.0)
            begin += _LONGEST
        cos, sin = (end - stop) * trial.turn[:, stop] if stop < samples else (0.0, 0.0)
        yield slice(begin, stop), (stop - begin, begin >= trial.first, edge, cos, sin)
        begin = stop


def _padded(count: int) -> int:
    return -(-count // LANES) * LANES


def _aligned(numbers: Floats) -> Floats:
    """A copy at an address that whole vectors may begin at."""
    room = np.empty(len(numbers) + LANES)
    first = -room.ctypes.data // 8 % LANES
    room[first : first + len(numbers)] = numbers
    return room[first : first + len(numbers)]


def _form(
    form: StreamFormat, fixed: bool, cycles: int, dead: Floats, estimator: FrequencyEstimator, first: int
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
        code_max=form.code_max,
        code_min=form.code_min,
        least_spread=two_fits.LEAST,
        most_spread=two_fits.MOST,
        spreads=two_fits.SPREADS,
        share=two_fits.SHARE,
        calm_share=two_fits.CALM_SHARE,
        calm=two_fits.CALM,
        few=two_fits.FEW,
    )
    result.scale[: len(form.scale)] = form.scale
    result.dead[: form.phases] = dead.ravel().tolist()
    result.bend[:] = frequency.BEND.ravel().tolist()
    return result
