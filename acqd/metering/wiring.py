"""Three-wire systems that are measured with two voltages and two currents (two wattmeters, Aron).

Pair 1 is the voltage from L1 to L2 and the current of L1, pair 2 the voltage from L3 to L2 and the current of L3. With
no neutral conductor the currents add up to zero (Blondel's theorem), and the star voltages refer to the point whose
voltages add up to zero. So three phases are made, sample by sample: their powers add up to the power of the two
wattmeters.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from acqd.metering.block import SampleBlock, StreamFormat
from acqd.metering.packed import State

_STAR = np.array(
    [
        # u12,    i1,   u32,    i3
        [2 / 3, 0.0, -1 / 3, 0.0],  # U1
        [0.0, 1.0, 0.0, 0.0],  # I1
        [-1 / 3, 0.0, -1 / 3, 0.0],  # U2
        [0.0, -1.0, 0.0, -1.0],  # I2
        [-1 / 3, 0.0, 2 / 3, 0.0],  # U3
        [0.0, 0.0, 0.0, 1.0],  # I3
    ]
)


class Aron:
    """Makes three phases of two pairs; the rows say that they are derived."""

    def __init__(self, form: StreamFormat) -> None:
        """Raises ValueError for a stream that has not two pairs."""
        if len(form.scale) != 4:
            raise ValueError(f'wiring = "aron" needs two pairs of channels, but the source has {form.phases} phases')
        self._input = form
        self._map = (_STAR * np.array(form.scale)).T
        self.form = replace(form, scale=(1.0,) * 6, bits=64)
        """Volts and amperes of three phases."""

    def state(self) -> State:
        """Nothing: every sample is by itself."""
        return {}

    def restore(self, _: State) -> None:
        """Go on."""

    def apply(self, block: SampleBlock) -> SampleBlock:
        """Star voltages and line currents of the same samples."""
        flags = block.flags | {"derived"} | (frozenset({"overrange"}) if block.overrange(self._input) else frozenset())
        return replace(block, codes=block.codes @ self._map, flags=flags)
