"""Codes of a converter with an offset as codes of 16 bits without one: a quarter of the memory of double numbers."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats
from acqd.metering.block import CODE_MAX, CODE_MIN
from acqd.sources.recording.channel import Column

_FINER = 64
"""Parts of a step of an 8-bit converter: an offset is rounded to a part, which is far below what such a step hides."""
_ALL = 1 << 16
_WHOLE = 1e-6
"""Of a step: an offset that near to whole steps is a number of them."""


@dataclass(frozen=True, slots=True)
class Steps:
    """value = scale x (code x factor + shift)."""

    scale: float
    factor: int
    shift: int

    def into(self, codes: NDArray[np.int16], values: NDArray[np.integer]) -> float:
        """Write the codes of `values` [samples]; their scale, in the unit of the file."""
        with np.errstate(over="ignore"):  # what leaves 16 bits comes back with the shift
            np.copyto(codes, values, casting="unsafe")
            if self.factor != 1:
                codes *= np.int16(self.factor)
            codes += np.int16((self.shift - CODE_MIN) % _ALL + CODE_MIN)
        return self.scale


def steps_of(column: Column) -> Steps | None:
    """How the values of a column become codes of 16 bits; None where they are no integers, or do not fit."""
    values: Floats | NDArray[np.integer] = column.values
    if values.dtype.kind not in "iu" or values.dtype.itemsize > 2 or not column.scale or not len(values):
        return None
    scale = abs(column.scale)
    factor, shift = 1, column.offset / scale
    if not abs(shift) < _ALL:
        return None
    if abs(shift - round(shift)) > _WHOLE:
        if values.dtype.itemsize > 1:
            return None
        factor, shift = _FINER, _FINER * shift
    signed = int(np.copysign(factor, column.scale))
    ends = [signed * int(end) + round(shift) for end in (values.min(), values.max())]
    if min(ends) < CODE_MIN or max(ends) > CODE_MAX:
        return None
    return Steps(scale / factor, signed, round(shift))
