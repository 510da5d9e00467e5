"""The structures and rows that `window.c` shares with Python."""

from __future__ import annotations

import ctypes

from acqd.metering.trial import CYCLES

LANES = 8
DONE, NO_HISTORY, NO_TRIAL, UNUSUAL = range(4)
"""Why a call ended."""
F, FLAGS, MAGNITUDE, BEND, SWELL, KINK, GROWTH, FIRST = range(8)
"""Rows of the result, before those of the phases: Hz, marks, the fundamental of all phases together [digits], and what
its cycles say (`onset.Cycles`)."""
UNSETTLED = 256
"""Mark of a window that is `unsettled`; bits 0 to 3 mark phases without mains, 4 to 7 phases over range."""
ENERGY, VRMS, IRMS, POWER, REACTIVE, QUANTITIES = range(6)
"""Quantities of phases, one row per phase: sum of products of codes, V, A, W, var of the fundamentals."""


class Form(ctypes.Structure):
    """What does not change in a stream."""

    _fields_ = (
        *((name, ctypes.c_int64) for name in ("bits", "fit", "fixed", "first_point", "few")),
        *(
            (name, ctypes.c_double)
            for name in (
                *("rate", "cycles", "grid", "slack", "f_low", "f_high", "trial_low", "trial_high"),
                *("purity", "steady", "code_max", "code_min"),
                *("least_spread", "most_spread", "spreads", "share", "calm_share", "calm"),
            )
        ),
        ("scale", ctypes.c_double * LANES),
        ("dead", ctypes.c_double * (LANES // 2)),
        ("bend", ctypes.c_double * CYCLES**2),
    )


class State(ctypes.Structure):
    """What one window leaves for the next."""

    _fields_ = (
        ("trial", ctypes.c_double),
        ("last", ctypes.c_double),
        ("change", ctypes.c_double),
        ("apart", ctypes.c_double),
        *((name, ctypes.c_int64) for name in ("known", "follows", "reason", "point")),
    )


class Live(ctypes.Structure):
    """What the windows of a running stream have in common: addresses; where the next one is, the state before it."""

    _fields_ = (
        *((name, ctypes.c_void_p) for name in ("form", "state", "table", "codes", "out")),
        ("begin", ctypes.c_int64),
        ("end", ctypes.c_int64),
        ("before", State),
    )
