"""Sink or page as a child process of the daemon: started, watched and stopped together with it."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import os
import sys
import time

from acqd.changes import StateLog
from acqd.daemon.child import end
from acqd.daemon.config import Config
from acqd.errors import UserError
from acqd.retry import Backoff

_log = logging.getLogger(__name__)
_STOP_S = 1.0
_STABLE_S = 5.0  # a child that lives longer than this works


class EmbeddedChild:
    """One `acqd COMMAND --embedded` with the daemon's configuration on stdin: passwords are no arguments."""

    def __init__(self, command: str, config: Config) -> None:
        """`command`: sink or web."""
        self._command, self._config = command, config
        self._process: asyncio.subprocess.Process | None = None

    async def start(self) -> None:
        """Start the process. Raises UserError with its reason when it cannot start."""
        process = await asyncio.create_subprocess_exec(
            *(sys.executable, "-P", "-m", "acqd", self._command, "--embedded", str(os.getpid())),
            stdin=asyncio.subprocess.PIPE,
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.PIPE,
            start_new_session=True,
        )
        assert process.stdin is not None and process.stdout is not None and process.stderr is not None
        process.stdin.write(self._config.model_dump_json().encode())
        process.stdin.close()
        if not await process.stdout.readline():
            message = (await process.stderr.read()).decode().strip()
            raise UserError(message.removeprefix("acqd: ") or f"acqd {self._command} did not start")
        self._log_lines = asyncio.create_task(_relay(self._command, process.stderr))
        self._process = process

    async def keep(self) -> None:
        """Start the process and watch it; one that cannot start is logged once, and the metering goes on without it."""
        try:
            await self.start()
        except (UserError, OSError) as error:
            _log.warning("%s: %s; the daemon goes on without it", self._command, error)
            return
        await self.watch()

    async def watch(self) -> None:
        """Start the process again whenever it ends: it must not end the metering."""
        says, backoff, name = StateLog(_log), Backoff(), f"embedded {self._command}"
        while True:
            assert self._process is not None
            begun = time.monotonic()
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(self._process.wait(), _STABLE_S)
            if self._process.returncode is None:
                says.fine(name, "runs again")
            code = await self._process.wait()
            backoff.ended(time.monotonic() - begun)
            says.trouble(name, "gone", f"ended with exit code {code}; starting it again")
            while self._process.returncode is not None:
                await asyncio.sleep(backoff.pause_s())
                try:
                    await self.start()
                except (UserError, OSError) as error:
                    says.trouble(name, "not started", f"{error}; trying again")

    async def stop(self) -> None:
        """Terminate the process; kill it if it takes longer than a second."""
        await end(self._process, _STOP_S)


async def _relay(command: str, stream: asyncio.StreamReader) -> None:
    """Copy the child's log lines to the daemon's log."""
    while line := await stream.readline():
        _log.info("%s: %s", command, line.decode(errors="replace").rstrip().removeprefix("acqd: "))
