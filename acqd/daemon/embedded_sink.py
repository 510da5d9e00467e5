"""The sink as a child process of the daemon: started, watched and stopped together with it."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import sys
import time

from acqd.changes import StateLog
from acqd.daemon.child import end
from acqd.daemon.config import Config
from acqd.errors import UserError
from acqd.retry import Backoff

_log = logging.getLogger(__name__)
_STOP_S = 1.0
_STABLE_S = 5.0  # a sink that lives longer than this works


class EmbeddedSink:
    """One `acqd sink` with the daemon's configuration, handed over on stdin: passwords are no arguments."""

    def __init__(self, config: Config) -> None:
        self._config = config
        self._process: asyncio.subprocess.Process | None = None

    async def start(self) -> None:
        """Start the process. Raises UserError when its database cannot be used."""
        process = await asyncio.create_subprocess_exec(
            *(sys.executable, "-P", "-m", "acqd", "sink", "--embedded"),
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
            raise UserError(message.removeprefix("acqd: ") or "the sink did not start")
        self._log_lines = asyncio.create_task(_relay(process.stderr))
        self._process = process

    async def watch(self) -> None:
        """Start the process again whenever it ends: it must not end the metering."""
        says, backoff = StateLog(_log), Backoff()
        while True:
            assert self._process is not None
            begun = time.monotonic()
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(self._process.wait(), _STABLE_S)
            if self._process.returncode is None:
                says.fine("embedded sink", "runs again")
            code = await self._process.wait()
            backoff.ended(time.monotonic() - begun)
            says.trouble("embedded sink", "gone", f"ended with exit code {code}; starting it again")
            while self._process.returncode is not None:
                await asyncio.sleep(backoff.pause_s())
                try:
                    await self.start()
                except (UserError, OSError) as error:
                    says.trouble("embedded sink", "not started", f"{error}; trying again")

    async def stop(self) -> None:
        """Terminate the process; kill it if it takes longer than a second."""
        await end(self._process, _STOP_S)


async def _relay(stream: asyncio.StreamReader) -> None:
    """Copy the sink's log lines to the daemon's log."""
    while line := await stream.readline():
        _log.info("sink: %s", line.decode(errors="replace").rstrip().removeprefix("acqd: "))
