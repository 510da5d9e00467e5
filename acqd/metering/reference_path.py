"""Windows metered with numpy: every kind, also those that the kernel leaves out, and the reference that it is held to.

Voltages without mains, gaps, the start of a stream, jumps of the mains and over-range samples are metered here.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats
from acqd.metering.block import Codes, StreamFormat
from acqd.metering.energy import EnergyColumns, EnergyRegister
from acqd.metering.frequency import Estimate, FrequencyEstimator
from acqd.metering.held import HeldFrequency
from acqd.metering.interval import interval_sums
from acqd.metering.jump import whole_cycle
from acqd.metering.marks import flag_window
from acqd.metering.piece import Piece
from acqd.metering.whole_cycles import CYCLES, channels, products_of, synchronous
from acqd.metering.window import WindowBatch


class ReferencePath:
    """Meters windows of one stream, and adds their energy to a register; f is shared with the kernel."""

    def __init__(
        self,
        form: StreamFormat,
        fixed: bool,
        dead: Floats,
        estimators: tuple[FrequencyEstimator, FrequencyEstimator],
        held: HeldFrequency,
    ) -> None:
        """`dead` [phases, 1] V below which there are no mains; `estimators` of f: usual, and of a first window."""
        self._form, self._fixed, self._dead = form, fixed, dead
        self._frequency, self._start_frequency = estimators
        self._held = held
        scale = np.asarray(form.scale)
        self._u_scale, self._i_scale = scale[0::2, None], scale[1::2, None]

    def whole(self, piece: Piece, energy: EnergyRegister) -> WindowBatch:
        """Meter consecutive windows with numpy."""
        if (noise := self._without_mains(piece, energy)) is not None:
            return noise
        u, i = channels(piece.codes[: piece.bounds[-1]])
        products = products_of(u, i)
        starts, ends = piece.bounds[:-1], piece.bounds[1:]
        estimate = self._estimate_f(u, i, ends)
        f, about, unsettled = self._held.usable(estimate)
        count = (ends - starts).astype(np.float64)
        energy_counts = np.add.reduceat(products[2], starts, axis=1)
        flags = piece.row_flags(self._form.phases)
        if self._fixed:
            means = np.add.reduceat(products, starts, axis=-1) / count
            live = np.sqrt(means[0]) * self._u_scale > self._dead
        else:
            held = self._held.fill(f, about)
            start, stop, short = synchronous(starts, ends, CYCLES * self._form.rate / held)
            _without_jumps(u, start, stop, np.flatnonzero(estimate.unsteady & np.isnan(about)))
            means = interval_sums(products, start, stop) / (stop - start)
            # The straight line through a cut cell can dip below zero where the voltage has just gone.
            np.maximum(means[:2], 0.0, out=means[:2])
            live = np.sqrt(means[0]) * self._u_scale > self._dead
            for k in np.flatnonzero(short).tolist():
                flag_window(flags, k, "start")
        if piece.first:
            flag_window(flags, 0, "start")
        dark = np.flatnonzero(~live.any(axis=0))
        if dark.size:
            # No mains, no cycle to be synchronous with: exactly this window.
            fixed = np.add.reduceat(products, starts, axis=-1) / count
            means[:, :, dark] = fixed[:, :, dark]
            f[dark] = np.nan
            if dark[-1] == len(f) - 1:
                self._frequency.reset()
                self._held.reset()
        for k in np.flatnonzero(np.isnan(f) & live.any(axis=0)).tolist():
            flag_window(flags, k, "transient")
        for k in np.flatnonzero(unsettled & ~np.isnan(f)).tolist():
            flag_window(flags, k, "unsettled")
        self._flag_phases(flags, live, piece.codes, piece.bounds)
        return self._columns(piece, energy.add(energy_counts), means, (f, estimate.reactive), flags)

    def broken(self, piece: Piece, energy: EnergyRegister) -> WindowBatch:
        """Meter one window with samples missing: its values are those of the longest unbroken run."""
        self._held.reset()
        runs = [channels(run) for run in piece.runs]
        energy_counts = sum(((u * i).sum(axis=1, keepdims=True) for u, i in runs), np.zeros((self._form.phases, 1)))
        u, i = max(runs, key=lambda run: run[0].shape[1])
        products = products_of(u, i)
        length = float(u.shape[1])
        cycle = self._form.rate / self._held.last
        span = cycle * min(CYCLES, int(length / cycle))
        if self._fixed:
            samples = sum(run[0].shape[1] for run in runs)
            means = sum(products_of(u, i).sum(axis=-1, keepdims=True) for u, i in runs) / samples
        elif span:
            start = np.array([(length - span) / 2])
            means = interval_sums(products, start, start + span) / span
            np.maximum(means[:2], 0.0, out=means[:2])
        else:
            means = np.full((3, self._form.phases, 1), np.nan)  # less than one cycle gives no value
        flags = piece.row_flags(self._form.phases)
        flag_window(flags, 0, "start" if piece.first else "gap")
        with np.errstate(invalid="ignore"):
            live = ~(np.sqrt(means[0]) * self._u_scale <= self._dead)
        joined = np.concatenate(piece.runs)
        self._flag_phases(flags, live, joined, np.array([0, len(joined)]))
        unknown = np.array([np.nan]), np.full((self._form.phases, 1), np.nan)
        power = np.full(self._form.phases, np.nan) if self._fixed else np.asarray(means)[2, :, 0]
        readings = energy.add_part(energy_counts[:, 0].tolist(), power.tolist())
        return self._columns(piece, readings, np.asarray(means), unknown, flags)

    def _without_mains(self, piece: Piece, energy: EnergyRegister) -> WindowBatch | None:
        """Meter windows in noise: exactly these windows. None where a voltage, or one before them, may be mains.

        A search for f would be nearly all of the cost, and finds none.
        """
        if self._frequency.trial is not None:
            return None
        codes = np.ascontiguousarray(piece.codes[: piece.bounds[-1]].T)
        starts = piece.bounds[:-1]
        count = np.diff(piece.bounds).astype(np.float64)
        x = codes.astype(np.float64)
        u, i = x[0::2], x[1::2]
        squares = np.add.reduceat(x * x, starts, axis=1) / count
        before = (u[:, : starts[0]] ** 2).mean(axis=1, keepdims=True) if starts[0] else 0.0
        if (np.sqrt(np.maximum(squares[0::2], before)) * self._u_scale > self._dead).any():
            return None
        most, least = codes.max(axis=1), codes.min(axis=1)
        counts = np.add.reduceat(u * i, starts, axis=1)
        flags = piece.row_flags(self._form.phases)
        if piece.first:
            flag_window(flags, 0, "start")
        self._frequency.reset()
        self._held.reset()
        if most.max() >= self._form.code_max or least.min() <= self._form.code_min:
            live = np.zeros((self._form.phases, len(starts)), dtype=bool)
            self._flag_phases(flags, live, piece.codes, piece.bounds)
        else:
            for phase in flags:
                for named in phase:
                    named.add("no_mains")
        unknown = np.full(len(starts), np.nan), np.full((self._form.phases, len(starts)), np.nan)
        means = np.stack((squares[0::2], squares[1::2], counts / count))
        return self._columns(piece, energy.add(counts), means, unknown, flags)

    def _estimate_f(self, u: Floats, i: Floats, ends: np.ndarray) -> Estimate:
        """f of each window; a run's first window may have its own samples only."""
        full, own = self._frequency, self._start_frequency
        short = int(np.searchsorted(ends, full.samples))
        if not short:
            return full.examine(u, ends, i)
        own.reset()
        first = own.examine(u, ends[:short], i)
        full.fits.interrupt()  # the two fits of fewer samples differ less
        full.trial = own.trial
        if short == len(ends):
            return first
        return first.followed_by(full.examine(u, ends[short:], i))

    def _flag_phases(self, flags: list[list[set[str]]], live: np.ndarray, codes: Codes, bounds: np.ndarray) -> None:
        """Mark over-range samples and dead voltages, phase by phase."""
        for phase, k in zip(*np.nonzero(~live), strict=True):
            flags[phase][k].add("no_mains")
        highest, lowest = self._form.code_max, self._form.code_min
        if codes.max() < highest and codes.min() > lowest:
            return
        stopped = (codes >= highest) | (codes <= lowest)
        hits = np.logical_or.reduceat(stopped[: bounds[-1]], bounds[:-1], axis=0)
        for k, channel in zip(*np.nonzero(hits), strict=True):
            flags[channel // 2][k].add("overrange")

    def _columns(
        self,
        piece: Piece,
        energy: EnergyColumns,
        means: Floats,
        fundamental: tuple[Floats, Floats],
        flags: list[list[set[str]]],
    ) -> WindowBatch:
        f, reactive = fundamental
        return WindowBatch(
            seq=piece.seq,
            utc_ns=piece.utc_ns,
            Vrms=np.sqrt(means[0]) * self._u_scale,
            Irms=np.sqrt(means[1]) * self._i_scale,
            P=means[2] * (self._u_scale * self._i_scale),
            f=f,
            imported=energy.imported,
            exported=energy.exported,
            Q1=reactive * (self._u_scale * self._i_scale),
            flags=flags,
        )


def _without_jumps(u: Floats, start: Floats, stop: Floats, windows: NDArray[np.intp]) -> None:
    """Bound some intervals to the cycle without the jump of the mains, where there is one."""
    for k in windows.tolist():
        if (whole := whole_cycle(u, float(start[k]), float(stop[k]))) is not None:
            start[k], stop[k] = whole
