"""The phase-locked loop of a channel as `kernel/quality.c` takes it."""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from ctypes import Array

from acqd.metering.quality import cycle_clock
from acqd.metering.quality.cycle_clock import CycleClock

_NAMES = ("pull", "steer", "jump", "lost", "range", "purity", "calm")


class Rules(ctypes.Structure):
    """Constants of the loop."""

    _fields_ = tuple((name, ctypes.c_double) for name in _NAMES)


class ClockState(ctypes.Structure):
    """What one call leaves for the next."""

    _fields_ = tuple((name, ctypes.c_double) for name in ("nominal", "half", "next", "amplitude", "astray"))


def states_of(clocks: Sequence[CycleClock]) -> Array[ClockState]:
    """The states of locked clocks."""
    return (ClockState * len(clocks))(
        *(ClockState(one.nominal, one.half, one.next or 0.0, one.amplitude, one.astray) for one in clocks)
    )


def give_back(states: Array[ClockState], clocks: Sequence[CycleClock]) -> None:
    """Put the states into the clocks."""
    for state, clock in zip(states, clocks, strict=True):
        clock.half, clock.next, clock.amplitude, clock.astray = state.half, state.next, state.amplitude, state.astray


_RULES = Rules(*(getattr(cycle_clock, name.upper()) for name in _NAMES))
RULES_AT = ctypes.addressof(_RULES)
"""Where the constants are."""
