"""SampleCount of a terminal, held against its distributed clock."""

from __future__ import annotations


class SampleCount:
    """Of one terminal.

    No document at hand says whether SampleCount counts blocks or samples: the first blocks that follow each other show
    that. A count that has never risen says nothing.
    """

    def __init__(self, samples: int, count_bytes: int) -> None:
        """`samples` of a block; `count_bytes` of SampleCount."""
        self._units = (1, samples, 0)
        self._counts = 1 << 8 * count_bytes
        self._unit = 0  # what the count rises by in a block; 0: it has not risen yet
        self._last: int | None = None

    def contradicts(self, count: int, periods: int) -> bool:
        """Whether the count of a block that ends `periods` blocks after the last one is another than expected."""
        last, self._last = self._last, count
        if last is None:
            return False
        fitting = [unit for unit in self._units if (count - last - periods * unit) % self._counts == 0]
        if not self._unit:
            self._unit = fitting[0] if fitting else 0
            return not fitting
        return self._unit not in fitting
