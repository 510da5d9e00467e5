"""For which sinks' databases delivered rows were sent again: once for each time that one lacked rows (ADR 31).

The broker keeps a sink's announcement, so a daemon reads it with every connection and after every start. In a file of
the spool: a lost or older one costs that rows are sent once more, which harms nothing.
"""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path

import orjson

from acqd.atomic import private
from acqd.regular_file import read_regular

_NAME = "recalls.json"
_MOST_SINKS = 64
_LONGEST = 200
"""Characters: a stranger may write announcements, too."""
_MOST_BYTES = 256 << 10


class Recalls:
    """Names of the last events by sink; for one thread."""

    def __init__(self, folder: Path | None) -> None:
        """Without `folder`, in memory."""
        self._path = None if folder is None else folder / _NAME
        self._events = self._read()

    def note(self, sink: str, event: str) -> bool:
        """Remember an event; whether it is new."""
        sink, event = sink[-_LONGEST:], event[:_LONGEST]
        if self._events.pop(sink, None) == event:
            self._events[sink] = event
            return False
        self._events[sink] = event
        while len(self._events) > _MOST_SINKS:
            del self._events[next(iter(self._events))]
        self._write()
        return True

    def _write(self) -> None:
        """No disk is waited for, and one that takes nothing is named elsewhere."""
        if self._path is None:
            return
        temporary = self._path.with_name(f".{_NAME}.new")
        with suppress(OSError):
            with open(temporary, "wb", opener=private) as file:
                file.write(orjson.dumps(self._events))
            temporary.replace(self._path)

    def _read(self) -> dict[str, str]:
        """The file; nothing where it is not there, or nobody can read it."""
        try:
            content = orjson.loads(read_regular(self._path, _MOST_BYTES)) if self._path is not None else {}
            return {str(sink): str(event) for sink, event in content.items()}
        except (OSError, ValueError, AttributeError):
            return {}
