"""Mains of 16 2/3 Hz (railways) and 400 Hz (aircraft, ground power), metered in compressed or stretched time.

A meter knows samples and not seconds: samples of 16 2/3 Hz at a rate r are those of 50 Hz at 3 r. So the meter of 50 Hz
meters them, and f, times and energies are converted back. A row then lasts 120 ms (two cycles) at 16 2/3 Hz; at 400 Hz
eight windows of 5 ms make a row of 40 ms.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, cast

import numpy as np

from acqd.metering.block import SampleBlock, StreamFormat
from acqd.metering.energy import EnergyRegister
from acqd.metering.meter import Meter, Mode
from acqd.metering.packed import State, packed, unpacked
from acqd.metering.window import WindowBatch

_LIKE = 50.0
_WINDOW = 0.04
"""s of the meter of 50 Hz."""
_ARRAYS = ("seq", "utc_ns", "f", "Vrms", "Irms", "P", "imported", "exported", "Q1")
"""Of a batch of windows."""


def row_window(form: StreamFormat, window: float = _WINDOW) -> float:
    """Seconds of a row: `window` for mains of 45 to 65 Hz."""
    if form.usual:
        return window
    return _WINDOW * _stretch(form) * _together(form)


def meter_for(
    form: StreamFormat,
    *,
    window: float = _WINDOW,
    mode: Mode = "synchronous",
    nominal_voltage: float = 230.0,
    energy: list[tuple[float, float]] | None = None,
    creep_W: float = 0.0,
) -> Meter:
    """The meter of a stream by its nominal frequency; the arguments are those of `Meter`. Raises ValueError."""
    if form.usual:
        return Meter(form, window=window, mode=mode, nominal_voltage=nominal_voltage, energy=energy, creep_W=creep_W)
    return OtherMainsMeter(form, mode, nominal_voltage, energy, creep_W)


def _stretch(form: StreamFormat) -> float:
    """Real seconds per second of the meter."""
    return _LIKE / form.f_nominal


def _together(form: StreamFormat) -> int:
    """Windows of the meter that make a row."""
    return max(1, round(1 / _stretch(form)))


class OtherMainsMeter(Meter):
    """Meters a stream as one of 50 Hz; `form` is that stream."""

    def __init__(
        self,
        form: StreamFormat,
        mode: Mode,
        nominal_voltage: float,
        energy: list[tuple[float, float]] | None,
        creep_W: float,
    ) -> None:
        """Raises ValueError for a rate outside the meter's range in its time."""
        self._stretch, self._count = _stretch(form), _together(form)
        like = replace(form, rate=form.rate * self._stretch, f_nominal=_LIKE)
        super().__init__(like, mode=mode, nominal_voltage=nominal_voltage)
        pairs = zip(form.scale[0::2], form.scale[1::2], strict=True)
        self.energy = EnergyRegister(
            [EnergyRegister.kwh_per_count(u, i, form.rate) for u, i in pairs],
            energy,
            integers=form.bits < 64,
            creep_kWh=creep_W * _WINDOW * self._stretch / 3.6e6,
        )
        self._origin: int | None = None
        self._waiting: list[WindowBatch] = []

    @property
    def indifferent(self) -> bool:
        """As `Meter.indifferent`: means of windows are not said to be."""
        return False

    def feed(self, block: SampleBlock) -> WindowBatch | None:
        """Meter every row that `block` completes; None when it completes none."""
        if self._origin is None:
            self._origin = block.utc_ns
        utc_ns = self._origin + round((block.utc_ns - self._origin) / self._stretch)
        batch = super().feed(replace(block, utc_ns=utc_ns))
        if batch is None:
            return None
        since = np.rint((batch.utc_ns - self._origin) * self._stretch).astype(np.int64)
        real = replace(batch, utc_ns=self._origin + since, f=batch.f / self._stretch)
        return real if self._count == 1 else self._rows(real)

    def state(self) -> State:
        """As `Meter.state`."""
        waiting = [
            {name: packed(getattr(part, name)) for name in _ARRAYS}
            | {"flags": [[sorted(each) for each in phase] for phase in part.flags]}
            for part in self._waiting
        ]
        return super().state() | {"origin": self._origin, "waiting": waiting}

    def restore(self, state: State) -> None:
        """As `Meter.restore`. Raises ValueError for what is no such state."""
        super().restore(state)
        try:
            self._origin = state["origin"]
            self._waiting = [
                WindowBatch(
                    **cast("dict[str, Any]", {name: unpacked(part[name]) for name in _ARRAYS}),
                    flags=[[set(each) for each in phase] for phase in part["flags"]],
                )
                for part in state["waiting"]
            ]
        except (KeyError, TypeError, AttributeError) as error:
            raise ValueError(f"no state of a meter: {error!r}") from None

    def _rows(self, batch: WindowBatch) -> WindowBatch | None:
        """Rows of `_count` windows with the same number; the last one waits until it is whole."""
        whole = WindowBatch.join([*self._waiting, batch])
        number = whole.seq // self._count
        complete = int(whole.seq[-1] + 1) % self._count == 0
        starts = np.flatnonzero(np.diff(number, prepend=number[0] - 1))
        ends = [*starts[1:].tolist(), len(number)]
        spans = list(zip(starts.tolist(), ends, strict=True))
        if not complete:
            self._waiting = [_part(whole, *spans.pop())]
        else:
            self._waiting = []
        return WindowBatch.join([_merged(_part(whole, *span), self._count) for span in spans]) if spans else None


def _part(batch: WindowBatch, begin: int, end: int) -> WindowBatch:
    """Windows begin .. end."""
    along = slice(begin, end)
    columns = {name: getattr(batch, name)[along] for name in ("seq", "utc_ns", "f")}
    rows = {name: getattr(batch, name)[:, along] for name in ("Vrms", "Irms", "P", "imported", "exported", "Q1")}
    return WindowBatch(**columns, **rows, flags=[phase[along] for phase in batch.flags])


def _merged(part: WindowBatch, count: int) -> WindowBatch:
    """One row of consecutive windows: RMS of RMS, means, the last registers, every flag."""
    known = np.isfinite(part.f)
    return WindowBatch(
        seq=part.seq[:1] // count,
        utc_ns=part.utc_ns[:1],
        Vrms=np.sqrt(_mean(part.Vrms**2)),
        Irms=np.sqrt(_mean(part.Irms**2)),
        P=_mean(part.P),
        f=part.f[known].mean(keepdims=True) if known.any() else np.array([np.nan]),
        imported=part.imported[:, -1:],
        exported=part.exported[:, -1:],
        Q1=_mean(part.Q1),
        flags=[[set().union(*phase)] for phase in part.flags],
    )


def _mean(values: np.ndarray) -> np.ndarray:
    """[phases, 1] over the windows with a value; NaN where there is none."""
    known = np.isfinite(values)
    count = known.sum(axis=1, keepdims=True)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.asarray(np.where(known, values, 0.0).sum(axis=1, keepdims=True) / count)
