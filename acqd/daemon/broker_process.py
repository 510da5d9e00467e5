"""The embedded broker as a child process: whatever strangers send to it, metering does not wait for it."""

from __future__ import annotations

import asyncio
import logging
import os
import resource
import sys

from acqd.daemon.child import end
from acqd.errors import UserError
from acqd.telemetry.ports import check_port

_log = logging.getLogger(__name__)
_STOP_S = 1.5
_AGAIN_S = 1.0
_MEMORY = 1 << 30
"""Bytes of the process: the broker keeps what absent subscribers have not received, without a limit."""


class BrokerProcess:
    """One `acqd broker`, started again when it ends."""

    def __init__(self, host: str, port: int) -> None:
        self._host, self._port = host, port
        self._process: asyncio.subprocess.Process | None = None
        self._watching: asyncio.Task[None] | None = None

    async def start(self) -> None:
        """Starts the process and waits until it listens. Raises UserError when it cannot."""
        check_port(self._host, self._port)
        await self._launch()
        self._watching = asyncio.create_task(self._watch())

    async def stop(self) -> None:
        """Terminates the process; kills it if it takes long."""
        if self._watching is not None:
            self._watching.cancel()
        await end(self._process, _STOP_S)

    async def _launch(self) -> None:
        process = await asyncio.create_subprocess_exec(
            *(sys.executable, "-P", "-m", "acqd", "broker", "--embedded", str(os.getpid())),
            *("--host", self._host, "--port", str(self._port)),
            stdin=asyncio.subprocess.DEVNULL,
            stdout=asyncio.subprocess.PIPE,
            start_new_session=True,
        )
        resource.prlimit(process.pid, resource.RLIMIT_DATA, (_MEMORY, _MEMORY))
        self._process = process
        assert process.stdout is not None
        if not await process.stdout.readline():
            raise UserError(f"the embedded broker does not start on {self._host}:{self._port}; the line above says why")

    async def _watch(self) -> None:
        """Starts the broker again, for ever."""
        while True:
            assert self._process is not None
            code = await self._process.wait()
            _log.error("the embedded broker ended with exit code %d; starting it again", code)
            await asyncio.sleep(_AGAIN_S)
            try:
                await self._launch()
            except UserError as error:
                _log.error("%s", error)
