"""The recent course of a value as a line of blocks."""

from __future__ import annotations

from collections import defaultdict, deque
from collections.abc import Iterable
from itertools import pairwise
from typing import Any

_BLOCKS = "▁▂▃▄▅▆▇█"
_KEPT = 60
_WIDTH = 12
_LEAST_SPAN = 0.02
"""Share of the value: what is less than this is noise."""


def sparkline(values: Iterable[float], width: int = _WIDTH) -> str:
    """Means of as many parts as there are columns, between their least and their largest."""
    known = list(values)
    count = min(width, len(known))
    if not count:
        return ""
    edges = [round(k * len(known) / count) for k in range(count + 1)]
    parts = [known[a:b] for a, b in pairwise(edges)]
    means = [sum(part) / len(part) for part in parts]
    low = min(means)
    span = max(max(means) - low, _LEAST_SPAN * max(map(abs, means)), 1e-12)
    return "".join(_BLOCKS[round((mean - low) / span * (len(_BLOCKS) - 1))] for mean in means)


class Traces:
    """The last minute of power of every channel."""

    def __init__(self) -> None:
        self._values: dict[tuple[str, str], deque[float]] = defaultdict(lambda: deque(maxlen=_KEPT))

    def add(self, summary: dict[str, Any]) -> None:
        """Take a summary; one without power is left out."""
        if summary["P"] is not None:
            self._values[summary["device"], summary["channel"]].append(float(summary["P"]))

    def lines(self) -> dict[tuple[str, str], str]:
        """A line of blocks by (device, channel)."""
        return {key: sparkline(values) for key, values in self._values.items()}
