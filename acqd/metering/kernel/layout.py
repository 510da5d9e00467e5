"""The structures and rows that `window.c` shares with Python."""

from __future__ import annotations

import ctypes

from acqd.metering.trial import CYCLES

LANES = 8
REMEMBERED = 3
DONE, NO_HISTORY, NO_TRIAL, UNUSUAL = range(4)
"""Why a call ended."""
RAW_F, F, FLAGS, PHASES = range(4)
"""Rows of the result, before those of the phases."""
VRMS, IRMS, POWER, ENERGY, U_DC, I_DC, U_PEAK, I_PEAK, U_RE, U_IM, I_RE, I_IM, PER_PHASE = range(13)
"""Rows of a phase: V, A, W, sum of products of codes, DC and peaks, fundamentals (real and imaginary parts)."""


class Form(ctypes.Structure):
    """What does not change in a stream."""

    _fields_ = (
        *((name, ctypes.c_int64) for name in ("bits", "fit", "fixed", "first_point")),
        *(
            (name, ctypes.c_double)
            for name in (
                *("rate", "cycles", "grid", "slack", "f_low", "f_high", "trial_low", "trial_high"),
                *("purity", "steady", "oldest", "code_max", "code_min"),
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
        ("f", ctypes.c_double * REMEMBERED),
        ("at", ctypes.c_double * REMEMBERED),
        *((name, ctypes.c_int64) for name in ("known", "reason", "point")),
    )
