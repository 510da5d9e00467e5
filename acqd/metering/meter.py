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

from acqd.metering.block import SampleBlock, StreamFormat
from acqd.metering.energy import EnergyRegister
from acqd.metering.frequency import F_MIN, FrequencyEstimator
from acqd.metering.held import HeldFrequency
from acqd.metering.kernel import Kernel, why_not
from acqd.metering.kernel.kernel import LiveMetered, Metered
from acqd.metering.kernel.layout import ENERGY, IRMS, POWER, REACTIVE, VRMS
from acqd.metering.marks import mark_phases
from acqd.metering.packed import State
from acqd.metering.piece import LiveWindow, Piece
from acqd.metering.reference_path import ReferencePath
from acqd.metering.stream import WindowStream
from acqd.metering.whole_cycles import CYCLES
from acqd.metering.window import OneWindow, WindowBatch, WindowGrid, batch_of

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
        start_frequency = FrequencyEstimator(form.rate, shortest)
        start_frequency.fits = self._frequency.fits
        self._held = HeldFrequency(form.f_nominal, window)
        history = max(fit, int(np.ceil(CYCLES * form.rate / (F_MIN - 1))) + 2) - shortest
        kernel = compiled and why_not(len(form.scale)) is None
        batch = _STREAMED if kernel else _BATCH_SAMPLES
        self._stream = WindowStream(self._grid, history, max(1, batch // shortest))
        digit = np.asarray(form.scale)[0::2, None]
        resolution = _QUANTISATION * digit if form.bits < 64 else np.zeros_like(digit)
        dead = np.maximum(INTERRUPTION * nominal_voltage, resolution)
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
        fixed, estimators = mode == "fixed", (self._frequency, start_frequency)
        self._numpy = ReferencePath(form, fixed, dead, estimators, self._held)
        self._kernel = Kernel(form, fixed, CYCLES, dead, self._frequency, self._held) if kernel else None

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

    @property
    def indifferent(self) -> bool:
        """Whether rows are the same to the last bit however the stream is cut into blocks; else to rounding."""
        return self.compiled

    def finish(self) -> int:
        """Samples received after the last whole window (they are in no row)."""
        return self._stream.pending

    def _whole(self, piece: Piece) -> WindowBatch:
        """Meter consecutive windows without a gap: the usual ones in C, the others with numpy."""
        if self._kernel is None:
            return self._numpy.whole(piece, self.energy)
        batches, done, doubted = [], 0, False
        while done < len(piece.seq):
            usual = None if doubted else self._kernel.meter(piece, done)
            doubted = usual is not None and usual.doubted
            if usual is not None:
                windows = slice(done, done + usual.rows.shape[1])
                batches.append(self._of_kernel(piece.seq[windows], piece.utc_ns[windows], piece.flags[windows], usual))
            elif (quiet := self._quiet(self._kernel, piece, done)) is not None:
                batches.append(quiet)
            else:
                self._kernel.give_back()
                batches.append(self._numpy.whole(piece.window(done), self.energy))
            done += len(batches[-1])
        return WindowBatch.join(batches)

    def _broken(self, piece: Piece) -> WindowBatch:
        if self._kernel is not None:
            self._kernel.give_back()  # it knows the last f
        return self._numpy.broken(piece, self.energy)

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
        for k, (_, mark, *_) in enumerate(found):
            mark_phases(flags, k, mark)
        numbers = np.array([quantities + readings for _, _, quantities, readings in found]).T
        Vrms, Irms, P, Q1, imported, exported = numbers.reshape(6, len(self._phases), -1)
        f = np.array([f for f, *_ in found])
        return WindowBatch(piece.seq[windows], piece.utc_ns[windows], Vrms, Irms, P, f, imported, exported, Q1, flags)

    def _live(self, kernel: Kernel, window: LiveWindow) -> WindowBatch:
        """Meter the one window that a block of a running stream completes."""
        metered = kernel.meter_live(window.buffer, window.begin, window.end, self.energy)
        if metered is None:
            metered = kernel.meter_quiet(window.buffer, window.begin, window.end, self.energy)
        if metered is None:
            kernel.give_back()
            return self._numpy.whole(window.piece(), self.energy)
        (f, mark, quantities, readings), flags = metered, None
        if mark or window.flags:
            flags = [[set(window.flags)] for _ in self._phases]
            mark_phases(flags, 0, mark)
        return batch_of(OneWindow(window.seq, window.utc_ns, f, quantities, readings, flags))

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
