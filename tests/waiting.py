"""Waiting for what another process or thread will do, without guessing how long it takes.

The limit only ends a test whose condition never comes true: it is long enough for a machine ten times slower that
does something else as well.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable, Coroutine
from typing import Any

LIMIT_S = 300.0


def wait_for(condition: Callable[[], object], what: str, timeout: float = LIMIT_S) -> None:
    """Return when the condition is true."""
    deadline = time.monotonic() + timeout
    while not condition():
        if time.monotonic() > deadline:
            raise AssertionError(f"not within {timeout} s: {what}")
        time.sleep(0.01)


async def until(condition: Callable[[], object], what: str, timeout: float = LIMIT_S) -> None:
    """The same in a coroutine."""
    deadline = time.monotonic() + timeout
    while not condition():
        if time.monotonic() > deadline:
            raise AssertionError(f"not within {timeout} s: {what}")
        await asyncio.sleep(0.01)


def finish(scenario: Coroutine[Any, Any, Any]) -> None:
    """Run a coroutine to its end, which must come."""
    asyncio.run(asyncio.wait_for(scenario, 2 * LIMIT_S))
