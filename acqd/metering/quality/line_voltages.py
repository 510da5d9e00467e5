"""The voltages between the lines of a stream of three phases, for events of three-wire systems."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from acqd.metering.block import SampleBlock, StreamFormat

LINE_TO_LINE = "line_to_line"
"""Flag of what is made of these voltages: L1 means L1-L2, L2 means L2-L3, L3 means L3-L1."""


def line_format(form: StreamFormat) -> StreamFormat:
    """The format of `line_voltages`. Raises ValueError without three phases."""
    if form.phases != 3:
        raise ValueError(f"voltages between lines need three phases, and the source has {form.phases}")
    return replace(form, scale=(1.0,) * 6, bits=64)


def line_voltages(block: SampleBlock, form: StreamFormat) -> SampleBlock:
    """U1-U2, I1, U2-U3, I2, U3-U1, I3 in V and A."""
    x = block.codes * np.asarray(form.scale)
    u = x[:, 0::2]
    x[:, 0::2] = u - u[:, [1, 2, 0]]
    return replace(block, codes=x, flags=block.flags | {LINE_TO_LINE})
