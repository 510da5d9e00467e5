"""Handle of a test on the double as a process."""

from __future__ import annotations

import json
import select
import subprocess
import sys
from pathlib import Path
from types import TracebackType
from typing import IO, Any

ROOT = Path(__file__).resolve().parents[3]
ANSWER_S = 20.0
"""Longest wait for an answer [s]."""


class MergingUnitProcess:
    """The double in a process of its own, from `with` on ready for commands.

    `options` are the command-line options with underscores: a list repeats its option, True gives an option without
    value, None and False leave it out. Raises RuntimeError where the process ends or refuses a command.

    >>> with MergingUnitProcess("veth0", rate=4000, clock="burst") as unit:
    ...     unit.burst(50)
    """

    def __init__(self, interface: str, **options: Any) -> None:
        self._arguments = [f"--interface={interface}"]
        for name, value in options.items():
            self._arguments += _option("--" + name.replace("_", "-"), value)
        self._process: subprocess.Popen[str] | None = None

    def __enter__(self) -> MergingUnitProcess:
        command = [sys.executable, "-m", "tests.doubles.sampled_values", *self._arguments]
        self._process = subprocess.Popen(
            command, cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        try:
            self._answer()
        except RuntimeError:
            self._end()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._end()

    def command(self, **fields: Any) -> dict[str, Any]:
        """Sends one command and returns its answer. Raises RuntimeError for an error."""
        _pipe(self._running().stdin).write(json.dumps(fields) + "\n")
        _pipe(self._running().stdin).flush()
        result = self._answer()
        if "error" in result:
            raise RuntimeError(result["error"])
        return result

    def start(self) -> None:
        """Lets the frames go by the real clock."""
        self.command(start=True)

    def burst(self, count: int) -> int:
        """Sends the next `count` frames of each stream at once; returns the number of frames on the wire."""
        return int(self.command(burst=count)["sent"])

    def stats(self, stream: int = 0) -> dict[str, int]:
        """Counters of a stream, as `unit.Lane.stats`."""
        counters: dict[str, int] = self.command(stats=True)["streams"][stream]
        return counters

    def _running(self) -> subprocess.Popen[str]:
        if self._process is None:
            raise RuntimeError("The merging unit was not started")
        return self._process

    def _answer(self) -> dict[str, Any]:
        output = _pipe(self._running().stdout)
        line = output.readline() if select.select([output], [], [], ANSWER_S)[0] else ""
        if not line:
            raise RuntimeError(f"The merging unit gave no answer: {self._complaint()}")
        answer: dict[str, Any] = json.loads(line)
        return answer

    def _complaint(self) -> str:
        """What the process wrote to stderr, once it has ended."""
        process = self._running()
        process.kill()
        return _pipe(process.stderr).read().strip() or f"exit status {process.wait()}"

    def _end(self) -> None:
        """Ends the process by closing its stdin."""
        process, self._process = self._running(), None
        try:
            process.communicate(timeout=ANSWER_S)
        except subprocess.TimeoutExpired:
            process.kill()
            process.communicate()


def _option(name: str, value: Any) -> list[str]:
    if value is None or value is False:
        return []
    if value is True:
        return [name]
    return [f"{name}={item}" for item in (value if isinstance(value, list) else [value])]


def _pipe(pipe: IO[str] | None) -> IO[str]:
    if pipe is None:
        raise RuntimeError("The process has no such pipe")
    return pipe
