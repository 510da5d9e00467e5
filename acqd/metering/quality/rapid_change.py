"""Rapid voltage changes of IEC 61000-4-30: from one steady voltage to another, without a dip or swell.

A voltage is steady while all Urms(1/2) of the last second are near their mean. A change begins with the value that ends
this in any phase. It ends a second before all phases are steady again, that is where the new steady voltage begins.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain, islice

from acqd.metering.quality.excursion import Open


@dataclass(slots=True)
class _Phase:
    """The last second of one phase."""

    recent: deque[float]
    begins: deque[float]
    total: float = 0.0
    low: float = math.inf
    """V: smallest and largest of `recent`."""
    high: float = -math.inf
    steady: bool = False
    mean: float = 0.0
    """V: of the last second, or of the last steady one."""
    change: float = 0.0
    """V: largest distance from `before` in this change."""
    before: float = 0.0
    reference: float = 1.0


class RapidChange:
    """Changes of one to three phases."""

    def __init__(self, phases: int, f_nominal: float, threshold: float, hysteresis: float) -> None:
        """`threshold`: share of the reference voltage; `hysteresis`: share of the threshold."""
        length = 120 if f_nominal > 55 else 100
        self._threshold, self._return = threshold, threshold * (1 - hysteresis)
        self._phases = [_Phase(deque(maxlen=length), deque(maxlen=length)) for _ in range(phases)]
        self._length = length
        self.open: Open | None = None
        self.end = 0.0
        """Sample number at which the change that is over has ended."""
        self.steady_change = 0.0
        """V: difference of the steady voltages before and after it."""

    def take(self, phase: int, begin: float, U: float, reference: float) -> bool:
        """The next value [V] of a phase, of a cycle that begins at `begin`: True when a change is over."""
        one = self._phases[phase]
        was_steady = all(other.steady for other in self._phases)
        self._look(one, begin, U, reference)
        if was_steady and not one.steady:
            self.open = Open("rvc", begin, set(), 0.0, reference)
            for other in self._phases:
                other.before, other.change = other.mean, 0.0
        if self.open is None:
            return False
        one.change = max(one.change, abs(U - one.before))
        if one.change > self._threshold * reference:
            self.open.phases.add(phase)
        return all(other.steady for other in self._phases)

    def stays_steady(self, bounds: Sequence[tuple[float, float]], reference: float) -> bool:
        """Whether all phases are steady, and stay so with values between `bounds` [phases][2] V, in any order."""
        if self.open is not None:
            return False
        limit = self._threshold * reference
        return all(
            one.steady
            and one.reference == reference
            and (high if high > one.high else one.high) - (low if low < one.low else one.low) <= limit
            for one, (low, high) in zip(self._phases, bounds, strict=True)
        )

    def take_steady(self, phase: int, begins: list[float], values: list[float]) -> None:
        """The next values [V] of a phase that stays steady."""
        one = self._phases[phase]
        gone = list(islice(chain(one.recent, values), len(values)))  # the values may last longer than a second
        one.recent.extend(values)
        one.begins.extend(begins)
        total = one.total
        for U, old in zip(values, gone, strict=True):  # in the order of `_look`, so that the last bit is the same
            total = total - old + U
        one.total = total
        if min(gone) <= one.low or max(gone) >= one.high:
            one.low, one.high = min(one.recent), max(one.recent)
        else:
            one.low, one.high = min(one.low, *values), max(one.high, *values)
        one.mean = total / len(one.recent)

    def close(self) -> Open:
        """The change that is over, with its results."""
        assert self.open is not None
        over, self.open = self.open, None
        largest = max(self._phases, key=lambda one: one.change / one.reference)
        over.extreme, over.reference = largest.change, largest.reference
        self.steady_change = max(abs(one.mean - one.before) for one in self._phases)
        self.end = max(over.begin, *(one.begins[0] for one in self._phases))
        return over

    def discard(self) -> None:
        """A dip or swell: no rapid change, and no new one before the voltage is steady again."""
        self.open = None

    def restart(self) -> None:
        """Forget the past: samples are missing."""
        self.open = None
        for one in self._phases:
            one.recent.clear()
            one.begins.clear()
            one.total, one.steady = 0.0, False
            one.low, one.high = math.inf, -math.inf

    def _look(self, one: _Phase, begin: float, U: float, reference: float) -> None:
        gone = one.recent[0] if len(one.recent) == self._length else None
        one.recent.append(U)
        if gone is not None:
            one.total -= gone
        if gone is not None and not one.low < gone < one.high:
            one.low, one.high = min(one.recent), max(one.recent)
        else:
            one.low, one.high = min(one.low, U), max(one.high, U)
        one.begins.append(begin)
        one.total += U
        one.reference = reference
        mean = one.total / len(one.recent)
        limit = (self._threshold if one.steady else self._return) * reference
        near = one.high - mean <= limit and mean - one.low <= limit
        one.steady = near and len(one.recent) == self._length
        if one.steady:
            one.mean = mean
