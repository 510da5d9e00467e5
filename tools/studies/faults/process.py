"""A process that is killed and started again, as systemd would do it."""

from __future__ import annotations

import os
import signal
import subprocess
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from acqd.errors import OperationError

_STOP_S = 10.0
_START_S = 60.0
"""Where others keep the computer busy, a start takes its time."""


@dataclass(slots=True)
class Process:
    """One service of the bed; its log goes to a file."""

    command: Sequence[str]
    log: Path
    ready: Callable[[], bool] = lambda: True
    options: dict[str, Any] = field(default_factory=dict)
    running: subprocess.Popen[bytes] | None = None
    deaths: int = 0
    """Times the process ended without having been asked to."""
    kills: int = 0
    """Times the process was given no time to end."""

    def start(self) -> None:
        """Start, and wait until it is ready. Raises OperationError when it is not within 60 s."""
        with self.log.open("ab") as log:
            self.running = subprocess.Popen(self.command, stdout=log, stderr=log, **self.options)
        deadline = time.monotonic() + _START_S
        while not self.ready():
            if self.running.poll() is not None or time.monotonic() > deadline:
                raise OperationError(f"{self.command[0]} does not start; see {self.log}")
            time.sleep(0.02)

    def send(self, number: signal.Signals) -> None:
        """A signal to the process, if it lives."""
        if self.running is not None and self.running.poll() is None:
            with suppress(ProcessLookupError):
                os.kill(self.running.pid, number)

    def kill(self) -> None:
        """SIGKILL, and wait for the end."""
        if self.running is not None and self.running.poll() is None:
            self.kills += 1
        self.send(signal.SIGKILL)
        if self.running is not None:
            self.running.wait()

    def lose_power(self) -> None:
        """SIGKILL for the process and its children at once: those of a database may wait for one another for ever."""
        for child in self._children():
            with suppress(ProcessLookupError):
                os.kill(child, signal.SIGKILL)
        self.kill()

    def stop(self, number: signal.Signals = signal.SIGTERM) -> None:
        """Ask for the end; kill what does not end."""
        self.send(signal.SIGCONT)
        self.send(number)
        if self.running is not None:
            try:
                self.running.wait(_STOP_S)
            except subprocess.TimeoutExpired:
                self.kill()

    def revive(self) -> None:
        """Start again what has ended by itself (Restart=always)."""
        if self.running is not None and self.running.poll() is not None:
            self.deaths += 1
            self.start()

    def child(self, word: bytes) -> int | None:
        """Pid of the child whose command line holds `word`."""
        for pid in self._children():
            with suppress(OSError):
                if word in Path(f"/proc/{pid}/cmdline").read_bytes():
                    return pid
        return None

    def family(self) -> list[int]:
        """Pids of the process, its children and theirs."""
        if self.running is None or self.running.poll() is not None:
            return []
        family = [self.running.pid]
        for pid in family:
            family += _children_of(pid)
        return family

    def _children(self) -> list[int]:
        alive = self.running is not None and self.running.poll() is None
        return _children_of(self.running.pid) if alive and self.running is not None else []


def _children_of(pid: int) -> list[int]:
    with suppress(OSError):
        return [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]
    return []
