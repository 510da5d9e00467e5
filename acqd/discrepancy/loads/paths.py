"""Viterbi paths of loads that are on or off: in C, and with numpy where there is no compiler."""

from __future__ import annotations

import ctypes
import functools

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
    loaded.acqd_path.argtypes = [ctypes.c_ssize_t, doubles, doubles, doubles, states, states]
    loaded.acqd_path.restype = None
    loaded.acqd_lasting.argtypes = [ctypes.c_ssize_t, ctypes.c_ssize_t, states]
    loaded.acqd_lasting.restype = None
    return loaded


def likeliest(stay: Floats, rise: Floats, fall: Floats) -> NDArray[np.bool_]:
    """[T] the likeliest states of a stretch.

    `stay` [T]: log-likelihood ratio of a row that is on; `rise`, `fall` [T]: of a switching in front of a row.
    """
    compiled = library()
    if compiled is None:
        return likeliest_in_numpy(stay, rise, fall)
    path, back = np.empty(len(stay), dtype=bool), np.empty(len(stay), dtype=bool)
    compiled.acqd_path(len(stay), *(np.ascontiguousarray(each, dtype=float) for each in (stay, rise, fall)), back, path)
    return path


def likeliest_in_numpy(stay: Floats, rise: Floats, fall: Floats) -> NDArray[np.bool_]:
    """The same, row by row."""
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
