"""Feeds systemd's watchdog from a thread, for as long as the service says that it does its work."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable

from acqd.daemon.notify import notify

_DEFAULT_S = 5.0


class Watchdog:
    """No call that blocks the service delays the feeding; a service that stands still is not fed.

    `alive` is asked in the thread of the watchdog: it must not wait, and it decides whether the standstill is one.
    """

    def __init__(self, alive: Callable[[], bool], send: Callable[[str], None] = notify) -> None:
        self._alive, self._send = alive, send
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._feed, name="watchdog", daemon=True)

    def start(self) -> None:
        """Feed from now on."""
        self._thread.start()

    def stop(self) -> None:
        """Feed no longer."""
        self._stopped.set()

    def _feed(self) -> None:
        pause_s = interval_s()
        while not self._stopped.is_set():
            if self._alive():
                self._send("WATCHDOG=1")
            self._stopped.wait(pause_s)


def interval_s() -> float:
    """Time between two feedings [s]: a third of what the unit allows (sd_watchdog_enabled(3))."""
    try:
        return max(0.05, int(os.environ["WATCHDOG_USEC"]) * 1e-6 / 3)
    except (KeyError, ValueError):
        return _DEFAULT_S
