"""Numbers that may be codes of a converter, and codes as none gives them: with exchanged bytes, with a constant bit."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acqd.errors import InputError
from acqd.metering.block import Codes
from acqd.sources.waveform import QUANTITIES

_LOOK = 100_000
"""Samples that are looked at."""
_SMOOTHER = 4.0
"""Times smoother with exchanged bytes: those of a wave look like noise."""
_LEAST_SPAN = 1024
"""Codes from the smallest to the largest: less shows nothing."""
_LEAST_LEVELS = 64
"""Different codes: below it a bit may be constant by chance."""

_MOST_CODE = 2**24
"""Converters have up to 24 bits."""
_LEVELS = 16
"""Different values of a channel: fewer are a test pattern or a few amperes, of which nobody makes codes."""


def are_whole(columns: Sequence[NDArray[Any]]) -> bool:
    """Whether all channels hold whole numbers that a converter can give."""
    return all((one == np.rint(one)).all() and np.abs(one).max() < _MOST_CODE for one in columns)


def may_be_codes(columns: Sequence[NDArray[Any]]) -> bool:
    """Whether channels without a unit may hold codes of a converter or mV: whole numbers, and many different ones."""
    return are_whole(columns) and max(len(np.unique(one[:_LOOK])) for one in columns) > _LEVELS


def remarks(path: Path, codes: Codes) -> tuple[str, ...]:
    """What to say of codes [samples, channels] of 16 bits. Raises InputError for exchanged bytes."""
    if codes.dtype != np.int16 or len(codes) < 2:
        return ()
    part = np.asarray(codes[:_LOOK], dtype=np.int16)
    swapped = [k for k in range(part.shape[1]) if _swapped(part[:, k])]
    if swapped:
        raise InputError(
            path,
            f"the two bytes of each code of {_names(swapped)} are exchanged (big-endian): write little-endian codes",
        )
    stuck = [(k, bit) for k in range(part.shape[1]) for bit in _stuck_bits(part[:, k])]
    return tuple(
        f"bit {bit} of the codes of {QUANTITIES[k]} never changes: its values are up to {1 << bit} digits wrong "
        "(converter, cable)"
        for k, bit in stuck
    )


def _names(channels: list[int]) -> str:
    return ", ".join(QUANTITIES[k] for k in channels)


def _swapped(x: NDArray[np.int16]) -> bool:
    if min(int(one.max()) - int(one.min()) for one in (x, x.byteswap())) < _LEAST_SPAN:
        return False
    rough, smooth = (float(np.abs(np.diff(one.astype(np.float32))).sum()) for one in (x, x.byteswap()))
    return 0 < _SMOOTHER * smooth < rough


def _stuck_bits(x: NDArray[np.int16]) -> list[int]:
    """Bits that are constant although lower and higher ones change."""
    constant = ~(np.bitwise_and.reduce(x) ^ np.bitwise_or.reduce(x))
    span = int(x.max()) - int(x.min())
    changing = [bit for bit in range(15) if not constant >> bit & 1]
    if not changing or span < _LEAST_SPAN:
        return []
    stuck = [bit for bit in range(changing[0] + 1, 14) if constant >> bit & 1 and span > 4 << bit]
    return stuck if stuck and len(np.unique(x)) >= _LEAST_LEVELS else []
