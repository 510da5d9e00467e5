"""The meter: a stream of sample blocks in, quantities per window out.

Stateful across windows (frequency, history, energy), indifferent to how the stream is cut into
blocks, and honest about what a gap, a start in mid-stream or a dead mains leaves unknown.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats
from acqd.metering.block import Codes, SampleBlock, StreamFormat
from acqd.metering.energy import EnergyRegister
from acqd.metering.frequency import F_MIN, Estimate, FrequencyEstimator
from acqd.metering.held import HeldFrequency
from acqd.metering.interval import interval_sums
from acqd.metering.jump import whole_cycle
from acqd.metering.kernel import Kernel, why_not
from acqd.metering.kernel.kernel import LiveMetered, Metered
from acqd.metering.kernel.layout import ENERGY, IRMS, POWER, REACTIVE, VRMS
from acqd.metering.marks import flag_window, mark_phases
from acqd.metering.packed import State
from acqd.metering.piece import LiveWindow, Piece
from acqd.metering.stream import WindowStream
from acqd.metering.whole_cycles import CYCLES, channels, products_of, synchronous
from acqd.metering.window import WindowBatch, WindowGrid

Mode = Literal["synchronous", "fixed"]

INTERRUPTION = 0.05
"""Share of the nominal voltage below which there is no mains (EN 50160: supply interruption)."""
_FREQUENCY_SPAN = 0.06  # s per frequency value: more lag than they have less noise
_QUANTISATION = 4.0  # digits: a voltage this small is the converter's noise whatever the nominal is
_BATCH_SAMPLES = 20_000  # per pass of numpy, so that the working set of one phase stays in the L2 cache
_STREAMED = 200_000  # per pass of the kernel, which reads them once: so that a pass costs more than its preparation


class Meter:
    """Meters one stream of one format."""

    def __init__(
        self,
        form: StreamFormat,
        *,
        window: float = 0.04,
        mode: Mode = "synchronous",
        nominal_voltage: float = 230.0,
        energy: list[tuple[float, float]] | None = None,
        creep_W: float = 0.0,
        compiled: bool = True,
    ) -> None:
        """`window` [s] 0.04 .. 0.05; `nominal_voltage` [V] sets the `no_mains` threshold.

        `energy` is each phase's (imported, exported) reading [kWh] to continue from. A window of a phase with less than
        `creep_W` [W] does not count. `compiled`: with the kernel in C
        where it can be built; both paths agree to 1e-9.

        Raises ValueError for a window outside its range.
        """
        if not 0.04 <= window <= 0.05:
            raise ValueError(f"window {window:g} s is outside 0.04 .. 0.05 s")
        self.form = form
        self.mode = mode
        self.creep_W = creep_W
        self._grid = WindowGrid(form.rate, window)
        shortest = int(window * form.rate)
        fit = max(shortest, int(_FREQUENCY_SPAN * form.rate))
        self._frequency = FrequencyEstimator(form.rate, fit, shortest)
        self._start_frequency = FrequencyEstimator(form.rate, shortest)
        self._start_frequency.fits = self._frequency.fits
        self._held = HeldFrequency(form.f_nominal, window)
        history = max(fit, int(np.ceil(CYCLES * form.rate / (F_MIN - 1))) + 2) - shortest
        kernel = compiled and why_not(len(form.scale)) is None
        batch = _STREAMED if kernel else _BATCH_SAMPLES
        self._stream = WindowStream(self._grid, history, max(1, batch // shortest))
        scale = np.asarray(form.scale)
        self._u_scale, self._i_scale = scale[0::2, None], scale[1::2, None]
        resolution = _QUANTISATION * self._u_scale if form.bits < 64 else np.zeros_like(self._u_scale)
        self._dead = np.maximum(INTERRUPTION * nominal_voltage, resolution)
        self.energy = EnergyRegister(
            [
                EnergyRegister.kwh_per_count(u, i, form.rate)
                for u, i in zip(form.scale[0::2], form.scale[1::2], strict=True)
            ],
            energy,
            integers=form.bits < 64,
            creep_kWh=creep_W * window / 3.6e6,
        )
        self._phases = range(form.phases)
        self._kernel = self._make_kernel() if kernel else None

    def _make_kernel(self) -> Kernel:
        fixed = self.mode == "fixed"
        return Kernel(self.form, fixed, CYCLES, self._dead, self._frequency, self._held)

    def feed(self, block: SampleBlock) -> WindowBatch | None:
        """Meter every window that `block` completes; None when it completes none."""
        if self._kernel is not None and (window := self._stream.live(block)) is not None:
            return self._live(self._kernel, window)
        batches = [self._broken(piece) if piece.broken else self._whole(piece) for piece in self._stream.feed(block)]
        return WindowBatch.join(batches) if batches else None

    def state(self) -> State:
        """All that decides how the next windows are metered, as JSON.

        Another meter that is made with the same arguments, takes this and is fed the same blocks makes the same rows,
        to the last bit, by the same kernel on the same kind of processor.
        """
        return {
            "stream": self._stream.state(),
            "frequency": self._frequency.state(),
            "held": self._held.state(),
            "energy": self.energy.state(),
            "kernel": self._kernel.state() if self._kernel is not None else None,
        }

    def restore(self, state: State) -> None:
        """Go on where `state` was taken. Raises ValueError for what is no such state."""
        try:
            self._stream.restore(state["stream"])
            self._frequency.restore(state["frequency"])
            self._held.restore(state["held"])
            self.energy.restore(state["energy"])
            if self._kernel is not None:
                self._kernel.restore(state["kernel"])
        except (KeyError, TypeError, AttributeError) as error:
            raise ValueError(f"no state of a meter: {error!r}") from None

    @property
    def compiled(self) -> bool:
        """Whether usual windows are metered by the kernel in C."""
        return self._kernel is not None

    def finish(self) -> int:
        """Samples received after the last whole window (they are in no row)."""
        return self._stream.pending

    def _whole(self, piece: Piece) -> WindowBatch:
        """Meter consecutive windows without a gap: the usual ones in C, the others with numpy."""
        if self._kernel is None:
            return self._reference(piece)
        batches, done = [], 0
        while done < len(piece.seq):
            usual = self._kernel.meter(piece, done)
            if usual is not None:
                windows = slice(done, done + usual.rows.shape[1])
                batches.append(self._of_kernel(piece.seq[windows], piece.utc_ns[windows], piece.flags[windows], usual))
            elif (quiet := self._quiet(self._kernel, piece, done)) is not None:
                batches.append(quiet)
            else:
                self._kernel.give_back()
                batches.append(self._reference(piece.window(done)))
            done += len(batches[-1])
        return WindowBatch.join(batches)

    def _quiet(self, kernel: Kernel, piece: Piece, first: int) -> WindowBatch | None:
        """The windows from number `first` on that follow one without mains and have none; None for no window."""
        codes, found = piece.codes, list[LiveMetered]()
        if (piece.first and not first) or not codes.flags.c_contiguous:
            return None
        for begin, end in pairwise(piece.bounds[first:].tolist()):
            metered = kernel.meter_quiet(codes, begin, end, self.energy)
            if metered is None:
                break
            found.append(metered)
        if not found:
            return None
        windows = slice(first, first + len(found))
        flags = [[set(names) for names in piece.flags[windows]] for _ in self._phases]
        for k, one in enumerate(found):
            mark_phases(flags, k, one.mark)
        Vrms, Irms, P, Q1, imported, exported = np.concatenate([one.quantities for one in found], axis=2)
        f = np.array([one.f for one in found])
        return WindowBatch(piece.seq[windows], piece.utc_ns[windows], Vrms, Irms, P, f, imported, exported, Q1, flags)

    def _live(self, kernel: Kernel, window: LiveWindow) -> WindowBatch:
        """Meter the one window that a block of a running stream completes."""
        metered = kernel.meter_live(window.buffer, window.begin, window.end, self.energy)
        if metered is None:
            metered = kernel.meter_quiet(window.buffer, window.begin, window.end, self.energy)
        if metered is None:
            kernel.give_back()
            return self._reference(window.piece())
        f, mark, (Vrms, Irms, P, Q1, imported, exported) = metered
        flags = [[set(window.flags)] for _ in self._phases]
        if mark:
            mark_phases(flags, 0, mark)
        return WindowBatch(
            np.array((window.seq,)), np.array((window.utc_ns,)), Vrms, Irms, P, np.array((f,)), imported, exported, Q1,
            flags,
        )  # fmt: skip

    def _of_kernel(
        self, seq: NDArray[np.int64], utc_ns: NDArray[np.int64], named: Sequence[frozenset[str]], usual: Metered
    ) -> WindowBatch:
        flags = [[set(names) for names in named] for _ in range(self.form.phases)]
        for k, mark in enumerate(usual.marks()):
            if mark:
                mark_phases(flags, k, mark)
        energy = self.energy.add(usual.of_phases(ENERGY))
        return WindowBatch(
            seq=seq,
            utc_ns=utc_ns,
            Vrms=usual.of_phases(VRMS),
            Irms=usual.of_phases(IRMS),
            P=usual.of_phases(POWER),
            f=usual.f,
            imported=energy.imported,
            exported=energy.exported,
            Q1=usual.of_phases(REACTIVE),
            flags=flags,
        )

    def _without_mains(self, piece: Piece) -> WindowBatch | None:
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
        flags = piece.row_flags(self.form.phases)
        if piece.first:
            flag_window(flags, 0, "start")
        self._frequency.reset()
        self._held.reset()
        if most.max() >= self.form.code_max or least.min() <= self.form.code_min:
            live = np.zeros((self.form.phases, len(starts)), dtype=bool)
            self._flag_phases(flags, live, piece.codes, piece.bounds)
        else:
            for phase in flags:
                for named in phase:
                    named.add("no_mains")
        unknown = np.full(len(starts), np.nan), np.full((self.form.phases, len(starts)), np.nan)
        return self._columns(piece, np.stack((squares[0::2], squares[1::2], counts / count)), unknown, counts, flags)

    def _reference(self, piece: Piece) -> WindowBatch:
        """Meter consecutive windows with numpy."""
        if (noise := self._without_mains(piece)) is not None:
            return noise
        u, i = channels(piece.codes[: piece.bounds[-1]])
        products = products_of(u, i)
        starts, ends = piece.bounds[:-1], piece.bounds[1:]
        estimate = self._estimate_f(u, i, ends)
        f, about, unsettled = self._held.usable(estimate)
        count = (ends - starts).astype(np.float64)
        energy_counts = np.add.reduceat(products[2], starts, axis=1)
        flags = piece.row_flags(self.form.phases)
        if self.mode == "fixed":
            means = np.add.reduceat(products, starts, axis=-1) / count
            live = np.sqrt(means[0]) * self._u_scale > self._dead
        else:
            held = self._held.fill(f, about)
            start, stop, short = synchronous(starts, ends, CYCLES * self.form.rate / held)
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
        return self._columns(piece, means, (f, estimate.reactive), energy_counts, flags)

    def _broken(self, piece: Piece) -> WindowBatch:
        """Meter one window with samples missing: its values are those of the longest unbroken run."""
        if self._kernel is not None:
            self._kernel.give_back()  # it knows the last f
        self._held.reset()
        runs = [channels(run) for run in piece.runs]
        energy_counts = sum(((u * i).sum(axis=1, keepdims=True) for u, i in runs), np.zeros((self.form.phases, 1)))
        u, i = max(runs, key=lambda run: run[0].shape[1])
        products = products_of(u, i)
        length = float(u.shape[1])
        cycle = self.form.rate / self._held.last
        span = cycle * min(CYCLES, int(length / cycle))
        if self.mode == "fixed":
            samples = sum(run[0].shape[1] for run in runs)
            means = sum(products_of(u, i).sum(axis=-1, keepdims=True) for u, i in runs) / samples
        elif span:
            start = np.array([(length - span) / 2])
            means = interval_sums(products, start, start + span) / span
            np.maximum(means[:2], 0.0, out=means[:2])
        else:
            means = np.full((3, self.form.phases, 1), np.nan)  # less than one cycle gives no value
        flags = piece.row_flags(self.form.phases)
        flag_window(flags, 0, "start" if piece.first else "gap")
        with np.errstate(invalid="ignore"):
            live = ~(np.sqrt(means[0]) * self._u_scale <= self._dead)
        joined = np.concatenate(piece.runs)
        self._flag_phases(flags, live, joined, np.array([0, len(joined)]))
        unknown = np.array([np.nan]), np.full((self.form.phases, 1), np.nan)
        return self._columns(piece, np.asarray(means), unknown, energy_counts, flags)

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
        highest, lowest = self.form.code_max, self.form.code_min
        if codes.max() < highest and codes.min() > lowest:
            return
        stopped = (codes >= highest) | (codes <= lowest)
        hits = np.logical_or.reduceat(stopped[: bounds[-1]], bounds[:-1], axis=0)
        for k, channel in zip(*np.nonzero(hits), strict=True):
            flags[channel // 2][k].add("overrange")

    def _columns(
        self,
        piece: Piece,
        means: Floats,
        fundamental: tuple[Floats, Floats],
        energy_counts: Floats,
        flags: list[list[set[str]]],
    ) -> WindowBatch:
        f, reactive = fundamental
        energy = self.energy.add(energy_counts)
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
