"""Commands of acqd that the page runs: one after another, in processes of low priority, with progress and an end."""

from __future__ import annotations

import asyncio
import contextlib
import os
import sys
from collections.abc import Callable, Sequence

import orjson
import sqlalchemy as sa

from acqd.daemon.child import end
from acqd.errors import UserError

_STOP_S = 5.0
_NICE = 15
_LINE_BYTES = 1 << 20
_OUTPUT_BYTES = 8 << 20
Told = Callable[[str, float], None]
"""Takes a step and the share of it that is done."""


class Commands:
    """At most one process at a time."""

    def __init__(self) -> None:
        self.process: asyncio.subprocess.Process | None = None

    async def run(self, arguments: Sequence[str], told: Told, secrets: dict[str, str] | None = None) -> bytes:
        """What a command writes to stdout. Raises UserError with its last line when it fails.

        `secrets`: variables of its environment; other users can read the arguments of a process.
        """
        self.process = process = await asyncio.create_subprocess_exec(
            *(sys.executable, "-P", "-m", "acqd", *arguments),
            stdin=asyncio.subprocess.DEVNULL,
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.PIPE,
            limit=_LINE_BYTES,
            env=os.environ | {"ACQD_PROGRESS": "lines"} | (secrets or {}),
            start_new_session=True,
        )
        with contextlib.suppress(ProcessLookupError):
            os.setpriority(os.PRIO_PROCESS, process.pid, _NICE)  # the chain that measures goes first
        written, said = await asyncio.gather(_output(process), _steps(process, told))
        if await process.wait():
            raise UserError(said.removeprefix("acqd: ") or f"acqd {arguments[0]} ended with code {process.returncode}")
        return written

    async def end(self) -> None:
        """End the process that runs."""
        await end(self.process, _STOP_S)


async def _output(process: asyncio.subprocess.Process) -> bytes:
    assert process.stdout is not None
    kept = bytearray()
    while piece := await process.stdout.read(1 << 16):
        kept += piece[: _OUTPUT_BYTES - len(kept)]
    return bytes(kept)


async def _steps(process: asyncio.subprocess.Process, told: Told) -> str:
    """The last line that is no progress."""
    assert process.stderr is not None
    said = ""
    while line := await process.stderr.readline():
        step = _step(line)
        if step is None:
            said = line.decode(errors="replace").strip() or said
        else:
            told(*step)
    return said


def _step(line: bytes) -> tuple[str, float] | None:
    with contextlib.suppress(orjson.JSONDecodeError, KeyError, TypeError, ValueError):
        content = orjson.loads(line)
        return str(content["step"]), min(max(float(content["share"]), 0.0), 1.0)
    return None


def without_password(database: str) -> str:
    """The database as an argument of a command."""
    return sa.make_url(database).set(password=None).render_as_string() if "://" in database else database


def password_of(database: str) -> dict[str, str]:
    """The password in the environment, where libpq looks for it."""
    password = sa.make_url(database).password if "://" in database else None
    return {"PGPASSWORD": str(password)} if password else {}
