"""Calls with a time limit, for a library that may wait for ever.

AdsLib's thread that reads ends when the connection does. If that happens in the middle of an answer, nobody wakes the
caller, whose own time-out has been set aside when the answer began. Nothing ends such a call: its thread is given up,
and what it waits for with it.
"""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable
from typing import Any, TypeVar

_T = TypeVar("_T")


class HangingError(Exception):
    """The call has not returned within its limit, and never may."""


class LimitedCalls:
    """Makes calls in one thread that outlives none of its hanging calls."""

    def __init__(self, limit_s: float) -> None:
        self._limit_s = limit_s
        self._calls: queue.SimpleQueue[Callable[[], None] | None] = queue.SimpleQueue()
        self._lost = False
        threading.Thread(target=self._run, name="ads", daemon=True).start()

    @property
    def lost(self) -> bool:
        """Whether a call hangs: no further one can be made."""
        return self._lost

    def __call__(self, work: Callable[..., _T], *arguments: Any) -> _T:
        """What `work` returns or raises. Raises HangingError after the limit."""
        if self._lost:
            raise HangingError
        done: queue.SimpleQueue[tuple[_T | None, BaseException | None]] = queue.SimpleQueue()

        def call() -> None:
            try:
                done.put((work(*arguments), None))
            except BaseException as error:  # raised again in the thread that waits
                done.put((None, error))

        self._calls.put(call)
        try:
            result, error = done.get(timeout=self._limit_s)
        except queue.Empty:
            self._lost = True
            raise HangingError from None
        if error is not None:
            raise error
        return result  # type: ignore[return-value]

    def end(self) -> None:
        """Let the thread end after the calls made so far."""
        self._calls.put(None)

    def _run(self) -> None:
        while (call := self._calls.get()) is not None:
            call()
