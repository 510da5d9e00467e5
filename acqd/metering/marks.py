"""Flags of windows, [phases][windows] sets."""

from __future__ import annotations

from acqd.metering.kernel.layout import UNSETTLED


def mark_phases(flags: list[list[set[str]]], window: int, mark: int) -> None:
    """Flags that the kernel gives phases, as in `kernel.Metered.marks`."""
    for phase, windows in enumerate(flags):
        if mark >> phase & 1:
            windows[window].add("no_mains")
        if mark >> phase & 16:
            windows[window].add("overrange")
        if mark & UNSETTLED:
            windows[window].add("unsettled")


def flag_window(flags: list[list[set[str]]], window: int, flag: str) -> None:
    """A flag of all phases of a window."""
    for phase in flags:
        phase[window].add(flag)
