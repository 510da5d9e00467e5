"""Wakes the sidecar when something changes in a folder, and now and then without a change."""

from __future__ import annotations

import asyncio
import logging
from pathlib import Path

from watchfiles import awatch

_log = logging.getLogger(__name__)
_IDLE_S = 2.0


class FolderWatch:
    """Notifications of the operating system; network shares send none."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._changed = asyncio.Event()

    async def run(self, stop: asyncio.Event) -> None:
        """Receives notifications until `stop`."""
        while not stop.is_set():
            try:
                async for _ in awatch(self._folder, stop_event=stop, step=20, debounce=50):
                    self._changed.set()
            except Exception as error:  # a name that is not UTF-8, too many watches: polling is enough
                reason = error.exceptions[0] if isinstance(error, BaseExceptionGroup) else error
                _log.warning("%s: no notifications of new files (%s), polling instead", self._folder, reason)
                await asyncio.sleep(_IDLE_S)

    async def pause(self, stop: asyncio.Event, seconds: float = _IDLE_S) -> None:
        """Waits for a change, for `stop`, or until `seconds` have passed."""
        self._changed.clear()
        waits = [asyncio.create_task(self._changed.wait()), asyncio.create_task(stop.wait())]
        await asyncio.wait(waits, timeout=seconds, return_when=asyncio.FIRST_COMPLETED)
        for wait in waits:
            wait.cancel()
