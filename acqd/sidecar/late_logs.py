"""Logs whose power rows have not arrived: they are tried again, because the sink catches up after an outage."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

_RETRY_S, _GIVE_UP_S = 30.0, 12 * 3600.0


@dataclass(slots=True)
class _LateLog:
    """Monotonic times."""

    give_up_s: float
    retry_s: float


class LateLogs:
    """Paths of late logs with the time of their next try."""

    def __init__(self) -> None:
        self._logs: dict[Path, _LateLog] = {}

    def __len__(self) -> int:
        return len(self._logs)

    def __iter__(self) -> Iterator[Path]:
        return iter(self._logs)

    def due(self) -> list[Path]:
        """Logs whose next try is due."""
        now = time.monotonic()
        return [path for path, late in self._logs.items() if now >= late.retry_s]

    def postpone(self, path: Path) -> bool:
        """Sets the next try of a log; False when it has been late too long."""
        now = time.monotonic()
        late = self._logs.setdefault(path, _LateLog(now + _GIVE_UP_S, now))
        late.retry_s = now + _RETRY_S
        return now < late.give_up_s

    def forget(self, path: Path) -> None:
        """Drops a log that is done or was removed."""
        self._logs.pop(path, None)
