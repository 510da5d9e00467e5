"""Labels of rows, such as program or part, as text: names in words, and numbers as short as they are."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats

Texts = NDArray[np.object_]
"""One str per row, empty where no label is known."""


def from_numbers(values: Floats) -> Texts:
    """[T] text of numbers [T]: 12 and not 12.0; empty for NaN."""
    distinct, which = np.unique(values, return_inverse=True)
    return np.array([f"{value:.12g}" if np.isfinite(value) else "" for value in distinct], dtype=object)[which]


def from_cells(cells: Sequence[Any]) -> Texts:
    """[T] text of the cells [T] of a column that holds words somewhere: the number 12.0 is 12 here, too."""
    known = {cell: _text(cell) for cell in set(cells)}  # a log has many rows and few labels
    return np.array([known[cell] for cell in cells], dtype=object)


def _text(cell: Any) -> str:
    if cell is None:
        return ""
    word = str(cell).strip()
    try:
        number = float(word)
    except ValueError:
        return word
    return f"{number:.12g}" if np.isfinite(number) else ""
