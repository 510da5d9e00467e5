"""What is wrong with three voltages by their phasors: missing, exchanged, reversed, of another ratio, late."""

from __future__ import annotations

import numpy as np

from acqd.arrays import Floats
from acqd.metering.phasors import FLOATING
from acqd.metering.wiring_finding import WiringFinding

_DEAD = 0.09
"""Of the largest voltage: two below it are missing; above it, the third has another ratio."""
_SAME_deg = 20.0
"""Voltages closer than this are one."""
_RATIO = 0.15
"""How far a voltage may be from the median of the three; supplies keep within 10 % (EN 50160)."""
_LATE_deg, _EQUAL_VOLTS, _STRAIGHT_deg = 3.5, 0.01, 0.5
"""A voltage that is so late or early although all three are alike in size and the two others lie 120 degrees apart:
unbalance of a supply changes sizes as well."""
_TURNED_deg = 30.0
"""By so much a voltage may be from its place, and is still the one of that place."""


def wrong_voltages(U: np.ndarray) -> list[WiringFinding]:
    """Of complex `U` [3], V; empty: nothing that the phasors show."""
    size = np.abs(U)
    median = float(np.median(size))
    if not median:
        return []
    reference = median if median > _DEAD * float(size.max()) else float(size.max())  # of two that are missing
    low = [f"u{k + 1}" for k in range(3) if size[k] < FLOATING * reference]
    if low:
        return [WiringFinding(f"{' and '.join(low)} missing or floating ({_volts(size)}): check fuse and terminal")]
    pairs = [(a, b) for a, b in ((0, 1), (0, 2), (1, 2)) if abs(_between(U[a], U[b])) < _SAME_deg]
    if pairs:
        a, b = pairs[0]
        return [WiringFinding(f"u{a + 1} and u{b + 1} are the same voltage: one of them is wired to the other's phase")]
    odd = [k for k in range(3) if abs(size[k] / median - 1) > _RATIO]
    ratio = size[odd[0]] / median if odd else 1.0
    between_lines = abs(ratio / np.sqrt(3) - 1) < 0.05
    reversed_ = _reversed_voltage(U)
    if reversed_ is not None and not between_lines:
        return [WiringFinding(f"u{reversed_ + 1} is reversed (180 degrees): exchange its two wires")]
    if odd:
        hint = "; is it a voltage between lines?" if between_lines else ""
        return [WiringFinding(f"u{odd[0] + 1} is {ratio:.3g} times the others ({_volts(size)}): check its ratio{hint}")]
    return _late(U)


def _late(U: np.ndarray) -> list[WiringFinding]:
    """One voltage that is as large as the others, and not 120 degrees from them."""
    if np.ptp(np.abs(U)) > _EQUAL_VOLTS * float(np.abs(U).min()):
        return []
    turn = np.sign(_between(U[0], U[1])) * 120  # the rotating field
    error = [(_between(U[k], U[(k + 1) % 3]) - turn + 180) % 360 - 180 for k in range(3)]  # from phase k to the next
    for k in range(3):
        after, straight, before = error[k], error[(k + 1) % 3], error[(k + 2) % 3]
        if abs(straight) < _STRAIGHT_deg and _LATE_deg < abs(before) < _TURNED_deg and abs(after + before) < 1.0:
            text = f"u{k + 1} is {abs(before):.2g} degrees {'late' if before < 0 else 'early'}"
            return [WiringFinding(f"{text}: do its samples come at another time than the others (u_delay_us)?")]
    return []


def _volts(size: Floats) -> str:
    return ", ".join(f"{value:.4g} V" for value in size)


def _between(a: complex, b: complex) -> float:
    """Angle from a to b [degrees]."""
    return float(np.degrees(np.angle(b * np.conj(a))))


def _reversed_voltage(U: np.ndarray) -> int | None:
    """The voltage whose reversal makes three of 120 degrees; None where they are, or where none does."""
    if _symmetric(U):
        return None
    return next((k for k in range(3) if _symmetric(np.where(np.arange(3) == k, -U, U))), None)


def _symmetric(U: np.ndarray) -> bool:
    return all(abs(abs(_between(U[a], U[b])) - 120) < _TURNED_deg for a, b in ((0, 1), (1, 2), (2, 0)))
