"""One of several sources of a daemon: started, and made again when it fails, while the other ones go on."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import uuid
from collections.abc import Callable

from acqd.daemon.config import Config
from acqd.daemon.feed import Feed
from acqd.errors import OperationError, SettingError, UserError
from acqd.retry import Backoff, RetryPolicy

_log = logging.getLogger(__name__)
_AGAIN = RetryPolicy(first_s=1.0, longest_s=30.0)
"""An attempt is a process that starts and looks for a device."""


class Box:
    """The feed of one source, for as long as the daemon runs."""

    def __init__(self, config: Config, make: Callable[[Config, str], Feed]) -> None:
        """`make` gets the configuration and a boot: rows of a feed that was made again begin at `seq` 0."""
        self.config, self._make = config, make
        self.name = ", ".join(config.devices)
        self.feed: Feed | None = None
        """The running feed; None until it has started."""
        self.trouble = ""
        """Why no feed is running; empty while one is."""
        self.mistake = ""
        """A setting that does not fit the source."""
        self.ended = False
        """Whether the source has come to its end."""
        self.restarts = -1
        self.tried = asyncio.Event()
        """Set after the first attempt to start."""
        self._stopping = asyncio.Event()

    async def run(self) -> None:
        """Until the source ends or `stop` is called."""
        backoff = Backoff(_AGAIN)
        while not self._stopping.is_set():
            try:
                await self._run_once()
            except SettingError as error:
                self.mistake = str(error)
                self._say(self.mistake)
            except (UserError, OperationError) as error:
                self._say(str(error))
            else:
                self.ended = True
                return
            finally:
                self.tried.set()
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(self._stopping.wait(), backoff.pause_s())

    async def stop(self) -> None:
        """End after the window in progress."""
        self._stopping.set()
        if self.feed is not None:
            await self.feed.stop()

    async def _run_once(self) -> None:
        feed = self._make(self.config, uuid.uuid4().hex[:12])
        try:
            await feed.start()
            self.feed = feed
            self.restarts += 1
            if self.trouble:
                _log.warning("source of %s: delivers", self.name)
            self.trouble = ""
            self.tried.set()
            await feed.run()
        finally:
            self.feed = None
            await feed.stop()
            await asyncio.to_thread(feed.save)
            feed.close()

    def _say(self, reason: str) -> None:
        """Log a change, not every attempt."""
        if reason != self.trouble:
            _log.error("source of %s: %s; trying again", self.name, reason)
        self.trouble = reason
