"""First-order filters along rows: compiled (`first_order.c`), or by scipy without a compiler.

What reads a model imports neither scipy.signal nor what that imports, which takes as much memory as numpy.
"""

from __future__ import annotations

import ctypes
import functools
from typing import Any

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats
from acqd.c_builds import first_order
from acqd.compiling import loaded_library
from acqd.errors import OperationError
from acqd.instruction_sets import best_instruction_set


@functools.cache
def library() -> ctypes.CDLL | None:
    """The compiled library; None without a compiler, or where the file is damaged."""
    try:
        loaded = loaded_library(first_order(best_instruction_set()))
    except OperationError:
        return None
    doubles, count, number = np.ctypeslib.ndpointer(np.float64, flags="C_CONTIGUOUS"), ctypes.c_ssize_t, ctypes.c_double
    loaded.acqd_first_order.argtypes = [count, count, count, number, number, number, doubles, doubles, doubles]
    loaded.acqd_first_order.restype = None
    return loaded


def filtered(
    b: tuple[float, float], a: float, values: NDArray[Any], state: NDArray[Any], together: int = 1
) -> tuple[Floats, Floats]:
    """[T / together, ...] y_t = b0 x_t + b1 x_(t-1) - a y_(t-1) of values x [T, ...], and the state [1, ...] behind.

    `state`: b1 x - a y of the row before the first; `together`: rows of which each result is the mean.

    Raises ValueError for a state that does not fit the values, and for rows that are no multiple of `together`.
    """
    if len(values) % together or (len(values) and np.shape(state) != (1, *np.shape(values)[1:])):
        raise ValueError(f"a state {np.shape(state)} and means of {together} rows do not fit values {np.shape(values)}")
    compiled = library()
    if compiled is None:
        return _in_scipy(b, a, values, state, together)
    x = np.ascontiguousarray(values, dtype=np.float64)
    after = np.array(state, dtype=np.float64, order="C")
    out = np.empty((len(x) // together, *x.shape[1:]))
    compiled.acqd_first_order(len(x), after.size, together, *b, a, x, after, out)
    return out, after


def _in_scipy(
    b: tuple[float, float], a: float, values: NDArray[Any], state: NDArray[Any], together: int
) -> tuple[Floats, Floats]:
    from scipy.signal import lfilter

    out, after = lfilter(b, [1.0, a], values, axis=0, zi=state)
    total = sum(out[k::together] for k in range(together))
    return np.asarray(total / together), np.asarray(after)
