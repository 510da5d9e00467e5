"""The compiled recursive Newton-Euler algorithm (`rigid_body.c`): many times faster than numpy's operations."""

from __future__ import annotations

import ctypes
import functools
from typing import TypeAlias

import numpy as np

from acqd.arrays import Floats
from acqd.c_builds import rigid_body
from acqd.compiling import loaded_library
from acqd.errors import OperationError
from acqd.instruction_sets import best_instruction_set

MOST_AXES = 16
Turned: TypeAlias = tuple[Floats, Floats]
"""Cosine and sine of angles: they take as long as the torques of one body."""


@functools.cache
def library() -> ctypes.CDLL | None:
    """The compiled library; None without a compiler, or where the file is damaged."""
    try:
        loaded = loaded_library(rigid_body(best_instruction_set()))
    except OperationError:
        return None
    doubles, count = np.ctypeslib.ndpointer(np.float64, flags="C_CONTIGUOUS"), ctypes.c_ssize_t
    loaded.acqd_joint_torques.argtypes = [
        count, count, doubles, ctypes.c_double, *[doubles] * 5, count, doubles, doubles,
    ]  # fmt: skip
    loaded.acqd_joint_torques.restype = None
    return loaded


def turned_by(q: Floats) -> Turned:
    """Cosine and sine of angles."""
    return np.cos(q), np.sin(q)


def torques(
    packed: Floats, gravity: float, links: Floats, q: Floats, qd: Floats, qdd: Floats, turned: Turned | None = None
) -> Floats | None:
    """Torques [n, T, axes] of n sets of bodies `links` [n, axes, 10] at a motion [T, axes]; None without a compiler.

    Raises ValueError for velocities `qd` or accelerations `qdd` that do not fit the angles `q`.

    `packed` [axes, 28]: of every joint the place, the direction of sliding, the rotations before and after the
    joint's own (3 x 3 each), the axis, and 1 if the joint slides. `gravity`: m/s^2. `turned`: of these angles.
    """
    compiled = library()
    if compiled is None or q.shape[1] > MOST_AXES:
        return None
    tau = np.empty((len(links), *q.shape))
    motion = [
        np.ascontiguousarray(np.broadcast_to(each, q.shape), dtype=np.float64)
        for each in (q, qd, qdd, *(turned or turned_by(q)))
    ]
    bodies = np.ascontiguousarray(links, dtype=np.float64)
    compiled.acqd_joint_torques(*q.shape, packed, gravity, *motion, len(links), bodies, tau)
    return tau
