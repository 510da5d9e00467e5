"""Where windows lie on the sample axis, and the columns that metering them gives."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, Any, cast

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats


@dataclass(frozen=True, slots=True)
class WindowGrid:
    """Windows of equal duration; with a rate that does not divide it, sizes differ by one sample."""

    rate: float
    """Sampling rate [1/s]."""
    duration: float
    """Window length [s]."""

    def start(self, number: int) -> int:
        """Index of the first sample of window `number`."""
        return math.floor(number * self.duration * self.rate + 0.5)

    def starts(self, first: int, count: int) -> NDArray[np.int64]:
        """Starts of windows first .. first + count (count + 1 values: the last is the end)."""
        if count == 1:  # live, where every microsecond of the wake-up counts
            return np.array([self.start(first), self.start(first + 1)])
        numbers = np.arange(first, first + count + 1)
        return np.asarray(np.floor(numbers * self.duration * self.rate + 0.5)).astype(np.int64)

    def containing(self, index: int) -> int:
        """Number of the window that sample `index` is in."""
        number = int(index / (self.duration * self.rate))
        while self.start(number) > index:
            number -= 1
        while self.start(number + 1) <= index:
            number += 1
        return number


@dataclass(slots=True)
class OneWindow:
    """Quantities of a single window as plain numbers: arrays of one number would take as long as the metering."""

    seq: int
    utc_ns: int
    f: float
    quantities: list[float]
    """Vrms, Irms, P, Q1 of all phases."""
    readings: list[float]
    """kWh: imported of all phases, then exported."""
    flags: list[list[set[str]]] | None
    """[phases][1] row flags; None: no row has a flag."""


class _Columns:
    """Makes the columns of a batch of one window when somebody asks for the first of them."""

    __slots__ = ("_one",)
    _one: OneWindow

    @property
    def _single(self) -> OneWindow | None:
        """The window of a batch whose columns nobody has read."""
        try:
            return cast("OneWindow", _the_one(self))
        except AttributeError:
            return None

    if not TYPE_CHECKING:  # to a type checker, every attribute would be there

        def __getattr__(self, name: str) -> Any:
            """Called for what is not there yet."""
            if name not in _NAMES:
                raise AttributeError(f"a batch of windows has no {name!r}")
            one, phases = self._one, len(self._one.readings) // 2
            rows = np.array((*one.quantities, *one.readings)).reshape(-1, phases, 1)
            self.Vrms, self.Irms, self.P, self.Q1, self.imported, self.exported = rows
            self.seq, self.utc_ns, self.f = np.array((one.seq,)), np.array((one.utc_ns,)), np.array((one.f,))
            self.flags = [[set()] for _ in range(phases)] if one.flags is None else one.flags
            del self._one  # what somebody changes in a column holds
            return getattr(self, name)


@dataclass(slots=True)  # frozen, it would take a microsecond longer to make, of the fifteen of a window
class WindowBatch(_Columns):
    """Quantities of consecutive windows; NaN where a quantity does not exist."""

    seq: NDArray[np.int64]
    """[windows] window number since stream start."""
    utc_ns: NDArray[np.int64]
    """[windows] UTC of each window's first sample [ns]."""
    Vrms: Floats
    """[phases, windows] V."""
    Irms: Floats
    """[phases, windows] A."""
    P: Floats
    """[phases, windows] active power [W]; positive is import."""
    f: Floats
    """[windows] Hz, from all phases."""
    imported: Floats
    """[phases, windows] imported energy register [kWh]."""
    exported: Floats
    """[phases, windows] exported energy register [kWh]."""
    Q1: Floats
    """[phases, windows] reactive power of the fundamentals [var], positive where the current lags; over two cycles."""
    flags: list[list[set[str]]]
    """[phases][windows] row flags."""

    def __len__(self) -> int:
        return 1 if self._single is not None else len(self.seq)

    @property
    def S(self) -> Floats:  # noqa: N802
        """[phases, windows] apparent power Vrms * Irms [VA]."""
        return self.Vrms * self.Irms

    @property
    def W(self) -> Floats:  # noqa: N802
        """[phases, windows] energy [kWh]: the gapless sum of u * i, import minus export."""
        return self.imported - self.exported

    def renumbered(self, shift: int) -> WindowBatch:
        """The same windows, `shift` numbers on."""
        return replace(self, seq=self.seq + shift) if shift else self

    @staticmethod
    def join(batches: list[WindowBatch]) -> WindowBatch:
        """One batch from several consecutive ones (at least one)."""
        if len(batches) == 1:
            return batches[0]
        along = {"seq": 0, "utc_ns": 0, "Vrms": 1, "Irms": 1, "P": 1, "f": 0, "imported": 1, "exported": 1}
        along["Q1"] = 1
        columns = {name: np.concatenate([getattr(b, name) for b in batches], axis=axis) for name, axis in along.items()}
        phases = len(batches[0].flags)
        flags = [[row for batch in batches for row in batch.flags[phase]] for phase in range(phases)]
        return WindowBatch(**columns, flags=flags)


_the_one = _Columns._one.__get__  # type: ignore[attr-defined,misc]  # past `__getattr__`, which makes columns


def batch_of(one: OneWindow) -> WindowBatch:
    """A batch of a single window."""
    batch = WindowBatch.__new__(WindowBatch)
    batch._one = one  # type: ignore[misc]  # mypy knows the slots of the dataclass only
    return batch


_NAMES = frozenset(field.name for field in fields(WindowBatch))


def windows_of(batch: WindowBatch) -> list[OneWindow]:
    """One by one, as plain numbers; a single live window without making its columns."""
    if (one := batch._single) is not None:
        return [one]
    quantities = np.concatenate((batch.Vrms, batch.Irms, batch.P, batch.Q1)).T.tolist()
    readings = np.concatenate((batch.imported, batch.exported)).T.tolist()
    named = zip(*batch.flags, strict=True)
    columns = (batch.seq.tolist(), batch.utc_ns.tolist(), batch.f.tolist(), quantities, readings, named)
    return [
        OneWindow(seq, utc_ns, f, numbers, kWh, [[names] for names in flags] if any(flags) else None)
        for seq, utc_ns, f, numbers, kWh, flags in zip(*columns, strict=True)
    ]
