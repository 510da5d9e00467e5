"""Labels of rows, such as program or part, as text: names in words, and whole numbers without decimals."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats

Texts = NDArray[np.object_]
"""One str per row, empty where no label is known."""
_WHOLE = re.compile(r"([+-]?\d+)\.0*")
_SCIENTIFIC = re.compile(r"[+-]?\d\.\d{2,}e[+-]\d+")
"""As numpy.savetxt writes every number."""
_EXACT = 2.0**53


def from_numbers(values: Floats) -> Texts:
    """[T] text of numbers [T]: 12 and not 12.0; empty for NaN."""
    distinct, which = np.unique(values, return_inverse=True)
    return np.array([_number(float(value)) for value in distinct], dtype=object)[which]


def from_cells(cells: Sequence[Any]) -> Texts:
    """[T] text of the cells [T] of a column. Only what is written as a whole number with decimals changes: 12.0 is 12.

    A name stays as it is, also where Python would read a number: 007, 10_20, 1E2.
    """
    known = {cell: _text(cell) for cell in set(cells)}  # a log has many rows and few labels
    return np.array([known[cell] for cell in cells], dtype=object)


def _text(cell: Any) -> str:
    if isinstance(cell, float | bool):
        return _number(float(cell))
    word = "" if cell is None else str(cell).strip()
    if word.lower() == "nan":
        return ""
    whole = _WHOLE.fullmatch(word)
    return whole[1] if whole else _number(float(word)) if _SCIENTIFIC.fullmatch(word) else word


def _number(value: float) -> str:
    if value.is_integer() and abs(value) < _EXACT:
        return str(int(value))
    return f"{value:.12g}" if np.isfinite(value) else ""
