"""Home Assistant as a process that the study asks questions."""

from __future__ import annotations

import json
import subprocess
import time
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Any, TextIO

from acqd.errors import OperationError
from acqd.telemetry.ports import free_port

_INSIDE = Path(__file__).with_name("inside.py")


class Probe:
    """One run of Home Assistant on a folder that keeps its configuration from run to run."""

    def __init__(self, python: Path, folder: Path) -> None:
        """`python`: interpreter of the environment with Home Assistant."""
        self._log: TextIO = (folder.parent / "homeassistant.log").open("a")
        command = [str(python), str(_INSIDE), str(folder), str(free_port())]
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=self._log, text=True
        )
        self._read()

    def ask(self, command: str, *arguments: object) -> Any:
        """The answer to a command of inside.Answers. Raises OperationError when Home Assistant has ended."""
        assert self._process.stdin is not None
        print(json.dumps([command, *arguments]), file=self._process.stdin, flush=True)
        return self._read()

    def wait_for(self, condition: Callable[[dict[str, Any]], object], what: str, limit_s: float = 60.0) -> bool:
        """Whether the entities come to meet a condition in time."""
        deadline = time.monotonic() + limit_s
        while time.monotonic() < deadline:
            if condition(self.ask("states")):
                return True
            time.sleep(0.5)
        print(f"not within {limit_s:.0f} s: {what}")
        return False

    def _read(self) -> Any:
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            raise OperationError(f"Home Assistant has ended; see {self._log.name}")
        return json.loads(line)

    def __enter__(self) -> Probe:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: object, trace: TracebackType | None) -> None:
        """Stop it as a user would; it writes its registry then."""
        assert self._process.stdin is not None
        self._process.stdin.close()
        try:
            self._process.wait(60)
        except subprocess.TimeoutExpired:
            self._process.kill()
        self._log.close()
