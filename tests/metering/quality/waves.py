"""Three-phase waves with a known truth, fed to the quality meter in blocks."""

from __future__ import annotations

import numpy as np

from acqd.metering import SampleBlock, StreamFormat
from acqd.metering.quality.meter import QualityMeter
from acqd.metering.quality.values import QualityValues

T0 = 1_700_000_000 * 10**9
"""UTC of the first sample [ns]: 200 s before a ten-minute tick."""


def three_phases(angle, volts=230.0, amperes=3.0, lag=0.5):
    """u, i of L1, L2, L3 [samples, 6]; `angle` [samples] of U1 in rad."""
    columns = []
    for k in range(3):
        turned = angle - 2 * np.pi * k / 3
        columns += [volts * np.sqrt(2) * np.cos(turned), amperes * np.sqrt(2) * np.cos(turned - lag)]
    return np.array(columns).T


def metered(x, rate=20_000.0, *, f_nominal=50.0, t0=T0, block=4_000, lost=(0, 0), flags=None, meter=None, **options):
    """Values of the physical samples `x` [samples, channels]; samples in `lost` never arrive."""
    meter = meter or QualityMeter(StreamFormat(rate, (1.0,) * x.shape[1], f_nominal, 64), **options)
    values: list[QualityValues] = []
    for first in range(0, len(x), block):
        part = x[first : first + block]
        if lost[0] <= first < lost[1]:
            continue
        named = frozenset((flags or {}).get(first, ()))
        values += meter.feed(SampleBlock(part, first, t0 + round(first * 1e9 / rate), flags=named))
    return values


def of_kind(values, kind="10/12"):
    return [one for one in values if one.kind == kind]
