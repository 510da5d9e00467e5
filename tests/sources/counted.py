"""Samples that tell their device number."""

from __future__ import annotations

import numpy as np

from acqd.metering import StreamFormat

RATE = 20_000.0


FORM = StreamFormat(RATE, (0.02, 0.0003))


def counted(first: int, count: int) -> np.ndarray:
    """Samples that tell their device number."""
    number = np.arange(first, first + count)
    return np.column_stack((number % 30_000, number // 30_000)).astype(np.int16)
