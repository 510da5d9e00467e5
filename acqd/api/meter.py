"""Metering of arrays."""

from __future__ import annotations

import time
from typing import Literal

import numpy as np

from acqd.arrays import Floats
from acqd.errors import UserError
from acqd.metering.block import SampleBlock, StreamFormat
from acqd.metering.other_mains import meter_for
from acqd.metering.window import WindowBatch

__all__ = ["Meter", "WindowBatch"]


class Meter:
    """Meters voltages and currents as they come, with the algorithms of the daemon.

    >>> t = np.arange(20_000) / 20_000
    >>> u, i = 325.27 * np.sin(100 * np.pi * t), 2.0 * np.sin(100 * np.pi * t - 0.5)
    >>> windows = Meter(20_000).feed(u, i)
    >>> len(windows), round(float(windows.P[0, -1]), 2), round(float(windows.f[-1]), 3)
    (25, 285.45, 50.0)
    """

    def __init__(
        self,
        rate: float,
        *,
        phases: Literal[1, 2, 3] = 1,
        f_nominal: float = 50.0,
        window_s: float = 0.04,
        mode: Literal["synchronous", "fixed"] = "synchronous",
        nominal_V: float = 230.0,
        start_ns: int | None = None,
    ) -> None:
        """`rate` [samples/s]; `start_ns`: UTC of the first sample (ns since 1970, default now).

        Raises UserError for a rate, frequency or window outside its range.
        """
        try:
            form = StreamFormat(rate, (1.0, 1.0) * phases, f_nominal, bits=64)
            self._meter = meter_for(form, window=window_s, mode=mode, nominal_voltage=nominal_V)
        except ValueError as error:
            raise UserError(str(error)) from None
        self._form = form
        self._start_ns = time.time_ns() if start_ns is None else start_ns
        self._fed = 0

    def feed(self, u: Floats, i: Floats) -> WindowBatch:
        """Meter the next samples: u [T] or [T, phases] in V, i in A. Returns the windows that they complete.

        A window that is not complete yet waits for the next call. Raises UserError for other shapes, or NaN.
        """
        codes = np.empty((len(u), 2 * self._form.phases))
        for offset, name, values in ((0, "u", u), (1, "i", i)):
            samples = np.asarray(values, dtype=np.float64)
            samples = samples[:, None] if samples.ndim == 1 else samples
            if samples.shape != (len(u), self._form.phases):
                raise UserError(f"{name} has the shape {samples.shape}, expected {(len(u), self._form.phases)}")
            if not np.isfinite(samples).all():
                wrong = int(np.flatnonzero(~np.isfinite(samples).all(axis=1))[0])
                raise UserError(f"{name} holds NaN or infinity at sample {wrong}; leave such samples out")
            codes[:, offset::2] = samples
        stamp = self._start_ns + round(self._fed / self._form.rate * 1e9)
        block = SampleBlock(codes, self._fed, stamp)
        self._fed += len(codes)
        return self._meter.feed(block) or _no_windows(self._form.phases)


def _no_windows(phases: int) -> WindowBatch:
    whole, reals = np.zeros(0, dtype=np.int64), np.zeros((phases, 0))
    return WindowBatch(whole, whole, reals, reals, reals, np.zeros(0), reals, reals, reals, [[] for _ in range(phases)])
