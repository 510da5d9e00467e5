"""Log lines for changes of state: what repeats at every attempt is counted, not written."""

from __future__ import annotations

import logging
import time
from collections.abc import Callable
from dataclasses import dataclass


@dataclass(slots=True)
class _State:
    name: str
    since: float
    repeated: int = 0


class StateLog:
    """Writes a line when the state of a subject changes, and not while the state lasts.

    A subject is what the state belongs to ("broker"); a state is a short name ("refused"). The text of the line may
    differ from attempt to attempt (ports, durations) without being a change.
    """

    def __init__(self, logger: logging.Logger, clock: Callable[[], float] = time.monotonic, of: str = "") -> None:
        """`of`: whose subjects these are, where several have subjects of the same names."""
        self._logger, self._clock, self._of = logger, clock, f" of {of}" if of else ""
        self._states: dict[str, _State] = {}

    def trouble(self, subject: str, state: str, text: str, level: int = logging.WARNING) -> bool:
        """The subject is in trouble; whether that is a change, and has been written."""
        known = self._states.get(subject)
        if known is not None and known.name == state:
            known.repeated += 1
            return False
        self._states[subject] = _State(state, known.since if known else self._clock(), known.repeated if known else 0)
        self._logger.log(level, "%s%s: %s", subject, self._of, text)
        return True

    def fine(self, subject: str, text: str, level: int = logging.WARNING) -> bool:
        """The subject works; written after trouble only, with how long that lasted and what was not written."""
        known = self._states.pop(subject, None)
        if known is None:
            return False
        again = f", {known.repeated} more failures" if known.repeated else ""
        lasted_s = self._clock() - known.since
        self._logger.log(level, "%s%s: %s (after %.1f s%s)", subject, self._of, text, lasted_s, again)
        return True

    def state(self, subject: str) -> str:
        """Name of the trouble that the subject is in; empty when it works."""
        known = self._states.get(subject)
        return known.name if known else ""


class Repeats:
    """Writes what happens again and again as a sum: at once the first time, then at most once a minute."""

    def __init__(
        self, logger: logging.Logger, pause_s: float = 60.0, clock: Callable[[], float] = time.monotonic
    ) -> None:
        """`pause_s` between two lines of one text."""
        self._logger, self._pause_s, self._clock = logger, pause_s, clock
        self._waiting: dict[str, int] = {}
        self._due: dict[str, float] = {}

    def count(self, number: int, text: str, level: int = logging.WARNING) -> None:
        """`text` has a %d for the sum."""
        waiting = self._waiting.get(text, 0) + number
        now = self._clock()
        if waiting and now >= self._due.get(text, now):
            self._logger.log(level, text, waiting)
            waiting, self._due[text] = 0, now + self._pause_s
        self._waiting[text] = waiting
