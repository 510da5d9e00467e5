"""The resolution of a register, from its values: a meter may round to 0.1 kW or to a power factor of 0.1.

A float shows its resolution as little as an integer behind a transformer ratio does; the values show it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

_ENOUGH = 3
"""Different values; one or two may be round by chance."""
_EXACT = 1e-6
"""Relative error of a float32 that holds a decimal number."""
_COARSEST, _FINEST = 4, -6
"""Powers of ten that are tried."""


@dataclass(slots=True)
class Resolution:
    """Of one register."""

    _power: int = _COARSEST
    _seen: set[float] = field(default_factory=set)

    @property
    def step(self) -> float:
        """Largest power of ten of which all values have been multiples; 0 while too few values are known."""
        return 10.0**self._power if len(self._seen) == _ENOUGH and self._power >= _FINEST else 0.0

    def feed(self, value: float) -> None:
        """The next value."""
        if value == 0 or not math.isfinite(value):
            return
        if len(self._seen) < _ENOUGH:
            self._seen.add(value)
        while self._power >= _FINEST:
            counts = value / 10.0**self._power
            if abs(counts - round(counts)) <= _EXACT * abs(counts):
                return
            self._power -= 1
