"""A double in a process of its own, as a context manager: its CPU time and its stalls are not the client's."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from types import TracebackType
from typing import IO, Any

_ROOT = Path(__file__).parents[3]


class ModbusProcess:
    """`with ModbusProcess("meters", "--model", "sdm630", "--rtu") as double: double.path; double.do("silent", unit=3)`.

    The arguments are those of `python -m tests.doubles.modbus`.
    """

    def __init__(self, *arguments: str) -> None:
        self._command = [sys.executable, "-m", "tests.doubles.modbus", *arguments]
        self.port = 0
        self.path = ""

    def __enter__(self) -> ModbusProcess:
        self._process = subprocess.Popen(
            self._command, cwd=_ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        try:
            ready = self._answer()
        except RuntimeError:
            self._end()
            raise
        self.port, self.path = ready.get("port", 0), ready.get("path", "")
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self._end()

    def _pipes(self) -> tuple[IO[str], IO[str]]:
        assert self._process.stdin is not None and self._process.stdout is not None
        return self._process.stdin, self._process.stdout

    def _end(self) -> None:
        to, back = self._pipes()
        to.close()
        try:
            self._process.wait(10)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        back.close()

    def _answer(self) -> dict[str, Any]:
        line = self._pipes()[1].readline()
        if not line:
            raise RuntimeError(f"{' '.join(self._command)} ended")
        answer: dict[str, Any] = json.loads(line)
        return answer

    @property
    def pid(self) -> int:
        """Process identifier, for measurements of its CPU time."""
        return self._process.pid

    def do(self, command: str, **arguments: Any) -> Any:
        """Execute a command of commands.py and return its result. Raises ValueError with the double's message."""
        to, _ = self._pipes()
        to.write(json.dumps({"do": command} | arguments) + "\n")
        to.flush()
        answer = self._answer()
        if not answer["ok"]:
            raise ValueError(answer["error"])
        return answer["result"]
