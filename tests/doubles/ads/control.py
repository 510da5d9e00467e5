"""A handle on the double in a process of its own."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from itertools import count
from pathlib import Path
from types import TracebackType
from typing import Any, Self

_ROOT = Path(__file__).parents[3]
_hosts = count(1)


def unused_host() -> str:
    """A loopback address that no other process and no earlier call uses: the TCP port of ADS is fixed."""
    pid = os.getpid()
    return f"127.{1 + pid // 250 % 250}.{1 + pid % 250}.{next(_hosts)}"


class AdsProcess:
    """Starts `python -m tests.doubles.ads` and sends it commands; a context manager.

    `clock`: "lockstep" or "real". `options` are further options of the command line, for example
    `AdsProcess("127.0.0.3", clock="real", drift_ppm=50)`.
    """

    def __init__(self, host: str = "127.0.0.2", *, clock: str = "lockstep", **options: object) -> None:
        self.host = host
        self.net_id = f"{host}.1.1"
        extra = [f"--{name.replace('_', '-')}={value}" for name, value in options.items()]
        self._arguments = [f"--host={host}", f"--clock={clock}", *extra]
        self._process: subprocess.Popen[str] | None = None

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()

    @property
    def pid(self) -> int:
        return self._running().pid

    def start(self) -> None:
        """Return when the double listens; raises RuntimeError if it ended before."""
        self._process = subprocess.Popen(
            [sys.executable, "-m", "tests.doubles.ads", *self._arguments],
            cwd=_ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        )  # fmt: skip
        self._read()

    def stop(self) -> None:
        """End the process by closing its standard input."""
        if self._process is not None:
            self._process.communicate(timeout=10)
            self._process = None

    def kill(self) -> None:
        """End the process at once, as a power failure would."""
        process = self._running()
        process.kill()
        process.communicate()
        self._process = None

    def command(self, **command: object) -> dict[str, Any]:
        """Send one command and return its answer; raises RuntimeError if the double reports an error."""
        stdin = self._running().stdin
        assert stdin is not None
        stdin.write(json.dumps(command) + "\n")
        stdin.flush()
        return self._read()

    def stats(self) -> dict[str, Any]:
        """Counters and state, see `Commands.stats`."""
        return self.command(stats=True)

    def _read(self) -> dict[str, Any]:
        stdout = self._running().stdout
        assert stdout is not None
        line = stdout.readline()
        if not line:
            raise RuntimeError(f"the ADS double on {self.host} ended with the exit status {self._running().wait()}")
        answer: dict[str, Any] = json.loads(line)
        if "error" in answer:
            raise RuntimeError(f"the ADS double reports: {answer['error']}")
        return answer

    def _running(self) -> subprocess.Popen[str]:
        if self._process is None:
            raise RuntimeError("the ADS double does not run")
        return self._process
