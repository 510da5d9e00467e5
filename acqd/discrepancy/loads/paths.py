"""Viterbi paths of loads that are on or off: in C, and with numpy where there is no compiler."""

from __future__ import annotations

import ctypes
import functools
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from acqd.arrays import Floats
from acqd.c_builds import switching
from acqd.compiling import loaded_library
from acqd.errors import OperationError


@functools.cache
def library() -> ctypes.CDLL | None:
    """The compiled library; None without a compiler, or where the file is damaged."""
    try:
        loaded = loaded_library(switching())
    except OperationError:
        return None
    doubles = np.ctypeslib.ndpointer(np.float64, flags="C_CONTIGUOUS")
    states = np.ctypeslib.ndpointer(np.bool_, flags="C_CONTIGUOUS")
    count, number = ctypes.c_ssize_t, ctypes.c_double
    loaded.acqd_path.argtypes = [count, count, doubles, number, number, doubles, states, doubles]
    loaded.acqd_path.restype = None
    loaded.acqd_lasting.argtypes = [count, count, states]
    loaded.acqd_lasting.restype = None
    return loaded


class White(NamedTuple):
    """White rows of a stretch [T], as a load sees them that draws its size times a level while on."""

    product: Floats
    """Of the residual and the level."""
    square: Floats
    """Of the level."""
    step: Floats
    """Product of the residual with the transient of a step at the row, times the level there."""
    cost: Floats
    """Square of the transient."""
    cross: Floats
    """Product of the transient with the level."""


class Path(NamedTuple):
    """States of a stretch, and what they explain."""

    on: NDArray[np.bool_]
    """[T]."""
    gain: float
    """Penalised log-likelihood ratio against always off, at the size of the search."""
    projected: float
    """Product of a load of size 1 on this path with the residual."""
    energy: float
    """Its square: the least-squares size is `projected` / `energy`."""


def likeliest(white: Floats, size: float, price: float, dwell: int) -> Path:
    """The Viterbi path of a load of a size, without states shorter than `dwell` rows.

    `white` [5, T]: a `White` in one array; `price`: log-likelihood that a switching pays.
    """
    compiled = library()
    if compiled is None:
        return likeliest_in_numpy(white, size, price, dwell)
    rows = white.shape[1]
    path, sums = np.empty(rows, dtype=bool), np.empty(3)
    compiled.acqd_path(rows, dwell, white, size, price, np.empty((4, rows)), path, sums)
    return Path(path, *sums.tolist())


def likeliest_in_numpy(white: Floats, size: float, price: float, dwell: int) -> Path:
    """The same with numpy."""
    product, square, step, cost, cross = white
    half = size * size / 2
    stay = size * product - half * square
    rise, fall = size * step - half * cost - 2 * half * cross - price, -size * step - half * cost - price
    on = lasting_in_numpy(viterbi(stay, rise, fall), dwell)
    change = np.diff(on.astype(int), prepend=int(on[0]))
    rises, falls = change > 0, change < 0
    return Path(
        on,
        float(stay[on].sum() + rise[rises].sum() + fall[falls].sum()),
        float(product[on].sum() + step[rises].sum() - step[falls].sum()),
        float(square[on].sum() + cost[change != 0].sum() + 2 * cross[rises].sum()),
    )


def viterbi(stay: Floats, rise: Floats, fall: Floats) -> NDArray[np.bool_]:
    """[T] the likeliest states of a stretch, row by row.

    `stay` [T]: log-likelihood ratio of a row that is on; `rise`, `fall` [T]: of a switching in front of a row.
    """
    came_from_on, came_from_off = (np.zeros(len(stay), dtype=bool) for _ in range(2))
    off, on = 0.0, float(stay[0]) - 1.0
    for k, (keeps, rises, falls) in enumerate(zip(stay.tolist(), rise.tolist(), fall.tolist(), strict=True)):
        if k == 0:
            continue
        switched_off, switched_on = on + falls, off + rises
        came_from_on[k], came_from_off[k] = switched_off > off, switched_on > on
        off, on = max(off, switched_off), max(on, switched_on) + keeps
    path = np.zeros(len(stay), dtype=bool)
    state = on > off
    for k in range(len(stay) - 1, -1, -1):
        path[k] = state
        state ^= bool(came_from_off[k] if state else came_from_on[k])
    return path


def lasting(path: NDArray[np.bool_], dwell: int) -> NDArray[np.bool_]:
    """The path [T] without states shorter than `dwell` rows, shortest first; states at the ends may be cut."""
    path = path.copy()
    compiled = library()
    if compiled is None:
        return lasting_in_numpy(path, dwell)
    compiled.acqd_lasting(len(path), dwell, path)
    return path


def lasting_in_numpy(path: NDArray[np.bool_], dwell: int) -> NDArray[np.bool_]:
    """The same; changes and returns `path`."""
    while True:
        edges = np.flatnonzero(np.diff(path.astype(int))) + 1
        lengths = np.diff(edges)
        if not len(lengths) or lengths.min() >= dwell:
            return path
        shortest = int(lengths.argmin())
        path[edges[shortest] : edges[shortest + 1]] ^= True
