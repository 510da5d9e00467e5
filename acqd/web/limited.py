"""HTTP connections, so few that strangers cannot use up the descriptors: of whoever has most, the worst makes room."""

from __future__ import annotations

import asyncio
from collections import Counter
from itertools import count
from typing import Any, ClassVar

from uvicorn.protocols.http.h11_impl import H11Protocol

MOST_CONNECTIONS = 400
"""Far more than viewers, and far fewer than the 1024 descriptors of a process."""
REQUEST_S = 10.0
"""For a client to say what it wants."""
_numbers = count()


class LimitedProtocol(H11Protocol):
    """uvicorn's protocol; a new connection beyond the limit ends one of the address that has most of them.

    One that has not asked, or has its answer, before one that does not read, before an old one.
    """

    most: int = MOST_CONNECTIONS
    request_s: float = REQUEST_S
    _silent: ClassVar[dict[Any, None]] = {}
    """Connections that had not asked when they were looked at last, oldest first: a flood of them costs little."""

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Called by asyncio."""
        super().connection_made(transport)
        self.number = next(_numbers)
        self._asked = asyncio.get_running_loop().call_later(self.request_s, self._end_unless_asked)
        if len(self.connections) > self.most:
            worst = self._oldest_silent() or self._worst()
            self.connections.discard(worst)
            worst.transport.abort()
        self._silent[self] = None

    def _oldest_silent(self) -> Any:
        while self._silent:
            oldest = next(iter(self._silent))
            del self._silent[oldest]
            if oldest.cycle is None and oldest in self.connections:
                return oldest
        return None

    def _worst(self) -> Any:
        others: Any = self.connections - {self}
        of = Counter(_address(each) for each in others)
        return min(others, key=lambda each: (-of[_address(each)], *_worth(each)))

    def connection_lost(self, exc: Exception | None) -> None:
        """Called by asyncio."""
        self._asked.cancel()
        self._silent.pop(self, None)
        super().connection_lost(exc)

    def _end_unless_asked(self) -> None:
        if self.cycle is None:
            self.transport.abort()


def _address(connection: Any) -> str | None:
    return connection.client[0] if connection.client else None


def _worth(connection: Any) -> tuple[bool, bool, int]:
    """Who has had an answer is worth least, then an answer that nobody reads, then an old one."""
    answering = connection.cycle is not None and not connection.cycle.response_complete
    return answering, not connection.flow.write_paused, connection.number
