"""Handle of a test on the segment's process."""

from __future__ import annotations

import json
import select
import subprocess
import sys
import time
from pathlib import Path
from types import TracebackType
from typing import Any, Literal, Self

ROOT = Path(__file__).parents[3]


class DoubleError(RuntimeError):
    """The segment's process did not start, refused a command or did not answer."""


class EtherCatDouble:
    """Runs `python -m tests.doubles.ethercat` on `interface` and sends it commands.

    `clock` is "lockstep" or "real"; `advance_ns` [ns] and `drift_ppm` are described there, `firmware` in `objects`.
    Raises DoubleError.
    """

    def __init__(
        self,
        interface: str,
        *,
        terminals: int = 1,
        clock: Literal["lockstep", "real"] = "lockstep",
        advance_ns: int | None = None,
        drift_ppm: float = 0.0,
        product: int | None = None,
        firmware: dict[str, Any] | None = None,
    ) -> None:
        command = [sys.executable, "-m", "tests.doubles.ethercat", "--interface", interface]
        command += ["--terminals", str(terminals), "--clock", clock, "--drift-ppm", str(drift_ppm)]
        command += [] if advance_ns is None else ["--advance-ns", str(advance_ns)]
        command += [] if product is None else ["--product", hex(product)]
        command += [] if firmware is None else ["--firmware", json.dumps(firmware)]
        self._process = subprocess.Popen(command, cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, bufsize=0)
        self._pending = b""
        try:
            answer = self._answer(20.0)
            if not answer.get("ready"):
                raise DoubleError(str(answer.get("error")))
        except DoubleError:
            self.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def command(self, **fields: Any) -> dict[str, Any]:
        """Send one command, for example `command(drop_frames=3)`, and return its answer. Raises DoubleError."""
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps(fields).encode() + b"\n")
        answer = self._answer(5.0)
        if "error" in answer:
            raise DoubleError(answer["error"])
        return answer

    def stats(self) -> dict[str, Any]:
        """Counters: frames, and of terminal 0 blocks_sent, first_block, last_block; `terminals` has those of each."""
        return self.command(stats=True)

    def close(self) -> None:
        """End the process: at the end of its input it stops by itself."""
        process = self._process
        for stream in (process.stdin, process.stdout):
            if stream is not None:
                stream.close()
        try:
            process.wait(5.0)
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()

    def _answer(self, timeout: float) -> dict[str, Any]:
        """Next line of the process, waited for at most `timeout` [s]."""
        stream = self._process.stdout
        assert stream is not None
        deadline = time.monotonic() + timeout
        while b"\n" not in self._pending:
            if not select.select([stream], [], [], max(0.0, deadline - time.monotonic()))[0]:
                raise DoubleError(f"no answer within {timeout} s")
            chunk = stream.read(65536)
            if not chunk:
                raise DoubleError(f"the process ended with status {self._process.wait()}")
            self._pending += chunk
        line, _, self._pending = self._pending.partition(b"\n")
        answer: dict[str, Any] = json.loads(line)
        return answer
