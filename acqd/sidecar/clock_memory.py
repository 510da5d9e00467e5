"""The clock of one controller, from log to log: the lags of the last logs and the clock line through them."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from acqd.dataset.align import SEARCH_S, Lag
from acqd.dataset.clock_line import ClockLine, deviates, fit_line

CLOCK_LINE = "clock line"
_REMEMBERED = 30  # logs
_SEARCH_MARGIN = 1.5  # times the last lag


class PlacedLag(NamedTuple):
    """The lag at which a log is compared with power."""

    seconds: float
    """Controller clock minus power clock."""
    by: str
    """clock line, own (of this log), or earlier logs."""


class ClockMemory:
    """Places logs, the one that arrived first before the others, and remembers their lags."""

    def __init__(self) -> None:
        self._lags: list[tuple[float, float, float, float]] = []
        """Controller time [s] at a log's middle, then the fields of its lag."""

    @property
    def last_lag_s(self) -> float:
        """Lag of the last log; 0 before the first."""
        return self._lags[-1][1] if self._lags else 0.0

    def search_s(self, limit_s: float) -> float:
        """Half the range within which the next log's lag is searched first."""
        return min(limit_s, _SEARCH_MARGIN * abs(self.last_lag_s) + SEARCH_S) if self._lags else limit_s

    def expected(self, middle_s: float, own: Lag) -> float | None:
        """The lag [s] to merge a log at before its own lag is refined; None when nothing credible is known.

        The clock line of the earlier logs if the log's own lag does not contradict it, else the own lag.
        """
        line = self._line(middle_s)
        if line is not None and not (own.credible and deviates(line, middle_s, own)):
            return float(line.at(middle_s))
        return own.seconds if own.credible else self._median()

    def place(self, middle_s: float, own: Lag) -> PlacedLag | None:
        """Remembers a credible lag; the placement by the line of the last logs, the own lag, or earlier logs.

        None when nothing credible is known. A credible lag that contradicts the line starts a new line: the clock
        was set.
        """
        line = self._line(middle_s, own)
        median = self._median()
        if own.credible:
            self._lags = [*self._lags, (middle_s, own.seconds, own.r2, own.ratio)][-_REMEMBERED:]
        if line is not None and own.credible and deviates(line, middle_s, own):
            self._lags = self._lags[-1:]
            return PlacedLag(own.seconds, "own")
        if line is not None:
            return PlacedLag(float(line.at(middle_s)), CLOCK_LINE)
        if own.credible:
            return PlacedLag(own.seconds, "own")
        return None if median is None else PlacedLag(median, "earlier logs")

    def as_json(self) -> list[list[float]]:
        """State for `restore`."""
        return [list(lag) for lag in self._lags]

    def restore(self, state: Any) -> None:
        """Continues from the state of `as_json`. Raises ValueError, TypeError."""
        self._lags = [(float(t), float(seconds), float(r2), float(ratio)) for t, seconds, r2, ratio in state]

    def _line(self, middle_s: float, *own: Lag) -> ClockLine | None:
        """Clock line through the remembered lags, and through the log's own lag if it is given."""
        times = [*(lag[0] for lag in self._lags), *(middle_s for _ in own)]
        return fit_line(np.array(times), [*(Lag(*lag[1:]) for lag in self._lags), *own])

    def _median(self) -> float | None:
        return float(np.median([lag[1] for lag in self._lags])) if self._lags else None
