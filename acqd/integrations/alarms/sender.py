"""Delivers notifications in order, one thread per target, again and again; what waits survives a restart."""

from __future__ import annotations

import logging
import threading
from collections import deque
from collections.abc import Callable, Sequence
from typing import Any

from acqd.integrations.alarms.targets import RefusedError, Target
from acqd.retry import Backoff, RetryPolicy

_log = logging.getLogger(__name__)
_MOST = 1000
"""Notifications that wait for a target; the oldest is lost then."""
_PATIENT = RetryPolicy(first_s=1.0, longest_s=300.0, stable_s=0.0)


class Sender:
    """Queues of all targets."""

    def __init__(self, targets: Sequence[Target], save: Callable[[], None], policy: RetryPolicy = _PATIENT) -> None:
        """`save` is called whenever what waits has changed."""
        self._lanes = [_Lane(target, save, policy) for target in targets]

    def __enter__(self) -> Sender:
        for lane in self._lanes:
            lane.thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        for lane in self._lanes:
            lane.end()

    def put(self, content: dict[str, Any]) -> None:
        """Tell all targets."""
        for lane in self._lanes:
            lane.put(content)

    def waiting(self) -> dict[str, list[dict[str, Any]]]:
        """What is not delivered, by target."""
        return {lane.target.name: lane.waiting() for lane in self._lanes}

    def restore(self, waiting: dict[str, list[dict[str, Any]]]) -> None:
        """What an earlier run has not delivered."""
        for lane in self._lanes:
            for content in waiting.get(lane.target.name, []):
                lane.put(content, save=False)


class _Lane:
    """One target and its thread."""

    def __init__(self, target: Target, save: Callable[[], None], policy: RetryPolicy) -> None:
        self.target, self._save, self._backoff = target, save, Backoff(policy)
        self._queue: deque[dict[str, Any]] = deque(maxlen=_MOST)
        self._changed = threading.Condition()
        self._ended = False
        self._trouble = ""
        self.thread = threading.Thread(target=self._run, name=target.name, daemon=True)

    def put(self, content: dict[str, Any], *, save: bool = True) -> None:
        with self._changed:
            self._queue.append(content)
            self._changed.notify()
        if save:
            self._save()

    def waiting(self) -> list[dict[str, Any]]:
        with self._changed:
            return list(self._queue)

    def end(self) -> None:
        with self._changed:
            self._ended = True
            self._changed.notify()
        self.thread.join(2.0)  # a target that hangs is left behind; what waits is in the state file

    def _run(self) -> None:
        while (content := self._next()) is not None:
            try:
                self.target.send(content)
            except RefusedError as error:
                _log.error("%s refuses %s: %s", self.target.name, content["key"], error)
            except (OSError, ValueError) as error:
                self._failed(str(getattr(error, "reason", None) or error))
                continue
            self._settle(content)

    def _next(self) -> dict[str, Any] | None:
        """The oldest notification, when there is one; None at the end."""
        with self._changed:
            self._changed.wait_for(lambda: self._queue or self._ended)
            return None if self._ended else self._queue[0]

    def _failed(self, reason: str) -> None:
        if reason != self._trouble:
            _log.warning("%s: %s; trying again", self.target.name, reason)
        self._trouble = reason
        with self._changed:
            self._changed.wait_for(lambda: self._ended, self._backoff.pause_s())

    def _settle(self, content: dict[str, Any]) -> None:
        self._trouble = ""
        self._backoff.reset()
        with self._changed:
            if self._queue and self._queue[0] is content:
                self._queue.popleft()
        self._save()
