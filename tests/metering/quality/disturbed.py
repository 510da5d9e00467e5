"""Three-phase voltages with a known disturbance, as blocks."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator

import numpy as np

from acqd.metering import SampleBlock, StreamFormat

RATE = 10_000.0


def voltages(envelope: Callable, *, f: float = 50.0, seconds: float = 4.0, phases: int = 3, volts: float = 230.0):
    """[samples, phases] V; `envelope(t, phase)` is the amplitude as a share."""
    t = np.arange(round(seconds * RATE)) / RATE
    return np.column_stack([
        envelope(t, k) * volts * np.sqrt(2) * np.sin(2 * np.pi * (f * t - k / 3) + 0.4) for k in range(phases)
    ])  # fmt: skip


def form(phases: int = 3, f_nominal: float = 50.0) -> StreamFormat:
    return StreamFormat(RATE, (1.0, 1.0) * phases, f_nominal, 64)


def blocks(u: np.ndarray, cuts: list[int] | None = None, index: int = 0) -> Iterator[SampleBlock]:
    codes = np.repeat(u, 2, axis=1)
    edges = [0, *(cuts or range(400, len(u), 400)), len(u)]
    for a, b in itertools.pairwise(edges):
        yield SampleBlock(codes[a:b], index + a, round((index + a) * 1e9 / RATE))
