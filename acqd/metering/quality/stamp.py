"""When a voltage changed, within the half cycles that show it.

The RMS of one cycle, renewed every half cycle, crosses a threshold up to a cycle and a half after the voltage has
changed, deep dips soon and shallow ones late; the way back is late the other way round. So the instants are taken from
the mean squares of half cycles, which do not overlap: from the old level to the new one, the half cycle in which the
voltage changed lies as far as its share of the change says.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence

LOOKED_AT = 4
"""Half cycles: the oldest has the old level, the newest the new one."""
_UNCHANGED = 0.1
"""Share of the change below which a half cycle does not show it."""


class HalfCycleLevels:
    """The last half cycles of one channel."""

    def __init__(self) -> None:
        self._squares: deque[float] = deque(maxlen=LOOKED_AT)

    def take(self, square: float) -> None:
        """The next half cycle: its mean square [V^2]."""
        self._squares.append(square)

    def take_all(self, squares: Sequence[float]) -> None:
        """The next half cycles."""
        self._squares.extend(squares)

    def clear(self) -> None:
        """The next half cycle does not follow the last one."""
        self._squares.clear()

    def fell(self) -> float:
        """How long before the end of the newest half cycle the voltage fell, if it did [half cycles]."""
        return since_change(list(self._squares), max)

    def rose(self) -> float:
        """How long before the end of the newest half cycle the voltage rose, if it did [half cycles]."""
        return since_change(list(self._squares), min)


def since_change(squares: Sequence[float], oldest: Callable[[Sequence[float]], float]) -> float:
    """Half cycles from the change to the end of the last of `squares` [V^2], mean squares of half cycles.

    `oldest` chooses the old level among them. If the last one alone shows the change, it may hold it anywhere: half a
    half cycle.
    """
    if len(squares) < 2:
        return 0.5
    new, old = squares[-1], oldest(squares)
    if old == new:
        return 0.5
    last_old = len(squares) - 1 - squares[::-1].index(old)
    shares = [min(max((one - old) / (new - old), 0.0), 1.0) for one in squares[last_old + 1 : -1]]
    if not shares or shares[-1] < _UNCHANGED:
        return 0.5
    return 1.0 + sum(shares)
