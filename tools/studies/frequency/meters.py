"""acqd and pqopen-lib on the same samples: f, voltage and power of two cycles each, and where these lie."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from acqd.arrays import Floats
from acqd.metering import Meter, SampleBlock, StreamFormat
from acqd.metering.block import Codes

DOUBT = frozenset({"transient", "unsettled", "start", "gap"})
_START = 5
"""Values of two cycles that are left out at the start: the filter of pqopen-lib settles in them."""


@dataclass(frozen=True, slots=True)
class Values:
    """Values of two cycles of L1, in the order of time."""

    begin: Floats
    """Samples; sample k is the cell [k, k + 1)."""
    end: Floats
    f: Floats
    """Hz."""
    V: Floats
    P: Floats
    doubted: np.ndarray
    """Whether the value is flagged."""

    def error(self, true_f: Callable[[Floats, Floats], Floats]) -> Floats:
        """f [Hz] against the mean f from `begin` to `end`."""
        return np.asarray(self.f - true_f(self.begin, self.end))

    def later(self) -> Values:
        """Without those at the start and the end."""
        part = slice(_START, -_START)
        return Values(
            *(getattr(self, name)[part] for name in ("begin", "end", "f", "V", "P", "doubted")),
        )


def acqd(codes: Codes, form: StreamFormat) -> Values:
    """Rows of acqd."""
    window = 0.05 if form.f_nominal > 55 else 0.04
    rows = Meter(form, window=window).feed(SampleBlock(codes, 0, 0))
    assert rows is not None
    size = window * form.rate
    length = 2 * form.rate / np.where(np.isnan(rows.f), form.f_nominal, rows.f)
    stop = (rows.seq + 1) * size
    end = np.where(length <= size, stop - (size - length) / 2, stop)
    doubted = np.array([bool(DOUBT & flags) for flags in rows.flags[0]])
    return Values(end - length, end, rows.f, rows.Vrms[0], rows.P[0], doubted).later()


def pqopen(codes: Codes, form: StreamFormat) -> Values:
    """Values of two periods of pqopen-lib."""
    from daqopen.channelbuffer import AcqBuffer
    from pqopen.powersystem import PowerSystem

    channels, block = len(form.scale), round(0.04 * form.rate)
    buffers = [AcqBuffer(size=len(codes) + 10, scale_gain=form.scale[k], name=f"c{k}") for k in range(channels)]
    system = PowerSystem(
        zcd_channel=buffers[0], input_samplerate=form.rate, nominal_frequency=form.f_nominal, nper=2,
    )  # fmt: skip
    for phase in range(channels // 2):
        system.add_phase(u_channel=buffers[2 * phase], i_channel=buffers[2 * phase + 1], name=str(phase + 1))
    system.enable_rms_trapz_rule()
    for start in range(0, len(codes), block):
        for channel, buffer in enumerate(buffers):
            buffer.put_data(codes[start : start + block, channel])
        system.process()
    read = {
        name: [np.asarray(x, dtype=np.float64) for x in system.output_channels[name].read_data_by_acq_sidx(0, 2**40)]
        for name in ("Freq", "U1_rms", "P1")
    }
    periods, at = read["Freq"]
    V, ends = read["U1_rms"]
    last = np.searchsorted(at, ends)  # the period that ends with the value
    keep = (last >= 1) & (last < len(at))
    last, ends = last[keep], ends[keep]
    f = 2 / (1 / periods[last] + 1 / periods[last - 1])
    never = np.zeros(len(f), dtype=bool)
    return Values(ends - 2 * form.rate / f, ends, f, V[keep], read["P1"][0][keep], never).later()
