"""One of several sources of a daemon: started, and made again when it fails, while the other ones go on."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import uuid
from collections.abc import Callable
from dataclasses import replace

from acqd.daemon.config import Config
from acqd.daemon.feed import Feed
from acqd.daemon.health.snapshot import BoxHealth, FeedHealth, SourceLink
from acqd.errors import OperationError, SettingError, UserError
from acqd.retry import Backoff, RetryPolicy

_log = logging.getLogger(__name__)
_AGAIN = RetryPolicy(first_s=1.0, longest_s=30.0)
"""An attempt is a process that starts and looks for a device."""
_NOTHING = FeedHealth("", SourceLink(False), None)


class Box:
    """The feed of one source, for as long as the daemon runs."""

    def __init__(self, config: Config, make: Callable[[Config, str], Feed]) -> None:
        """`make` gets the configuration and a boot: rows of a feed that was made again begin at `seq` 0."""
        self.config, self._make = config, make
        self.name = ", ".join(config.devices)
        # One attribute: a thread that counts finds a feed either running or among the earlier ones.
        self._now: tuple[Feed | None, FeedHealth] = None, _NOTHING
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

    @property
    def feed(self) -> Feed | None:
        """The running feed; None while there is none."""
        return self._now[0]

    def health(self) -> BoxHealth:
        """The source now, with what its earlier feeds have counted; in any thread."""
        feed, earlier = self._now
        now = feed.health() if feed is not None else _NOTHING
        source = SourceLink(
            now.source.connected or self.ended,
            now.source.reconnects + earlier.source.reconnects,
            self.trouble or now.source.trouble,
            now.source.lost + earlier.source.lost,
        )
        return BoxHealth(
            self.name,
            tuple(self.config.devices),
            self.config.source.kind,
            source,
            alive=feed is None or feed.alive(),
            ended=self.ended,
            restarts=max(self.restarts, 0),
            boot=now.boot,
            last_row_age_s=now.last_row_age_s,
            windows=now.windows + earlier.windows,
            cycles=now.cycles,
            synchronised=now.synchronised,
            register_trouble=now.register_trouble,
        )

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
        feed, earlier = self._make(self.config, uuid.uuid4().hex[:12]), self._now[1]
        try:
            await feed.start()
            self._now = feed, earlier
            self.restarts += 1
            if self.trouble:
                _log.warning("source of %s: delivers", self.name)
            self.trouble = ""
            self.tried.set()
            await feed.run()
        finally:
            if self.feed is not None:
                self._now = None, _together(earlier, feed.health())
            await feed.stop()
            await asyncio.to_thread(feed.save)
            feed.close()

    def _say(self, reason: str) -> None:
        """Log a change, not every attempt."""
        if reason != self.trouble:
            _log.error("source of %s: %s; trying again", self.name, reason)
        self.trouble = reason


def _together(earlier: FeedHealth, last: FeedHealth) -> FeedHealth:
    """The counts of feeds that have ended."""
    lost, again = earlier.source.lost + last.source.lost, earlier.source.reconnects + last.source.reconnects
    return replace(_NOTHING, source=SourceLink(False, again, "", lost), windows=earlier.windows + last.windows)
