"""Commands of acqd that the page runs: one after another, in processes of low priority, with progress and an end."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import os
import signal
import sys
from collections.abc import Callable, Sequence

import orjson
import sqlalchemy as sa

from acqd.daemon.child import end
from acqd.errors import UserError

_STOP_S = 5.0
_LINE_BYTES = 1 << 16
_SAID_LETTERS = 1000
_OUTPUT_BYTES = 8 << 20
_SECRETS = ("password", "sslpassword")
"""Of the query of a database's URL."""
_log = logging.getLogger(__name__)
Told = Callable[[str, float], None]
"""Takes a step and the share of it that is done."""


class Commands:
    """At most one process at a time."""

    def __init__(self) -> None:
        self.process: asyncio.subprocess.Process | None = None

    async def run(self, arguments: Sequence[str], told: Told, secrets: dict[str, str] | None = None) -> bytes:
        """What a command writes to stdout. Raises UserError with its last line when it fails.

        The process has ended when this function ends, however it ends. `secrets`: variables of its environment; other
        users can read the arguments of a process.
        """
        self.process = process = await asyncio.create_subprocess_exec(
            *(sys.executable, "-P", "-m", "acqd.cli.errand", *arguments),
            stdin=asyncio.subprocess.DEVNULL,
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.PIPE,
            env=os.environ | {"ACQD_PROGRESS": "lines"} | (secrets or {}),
            start_new_session=True,
        )
        try:
            written, said = await asyncio.gather(_output(process), _steps(process, told))
            code = await process.wait()
        finally:
            await end(process, _STOP_S)
        if code == -signal.SIGKILL:
            raise UserError(f"acqd {arguments[0]} was killed: it needs more memory than there is; see MemoryMax")
        if code:
            raise UserError(said.removeprefix("acqd: ") or f"acqd {arguments[0]} ended with code {code}")
        return written


async def _output(process: asyncio.subprocess.Process) -> bytes:
    assert process.stdout is not None
    kept = bytearray()
    while piece := await process.stdout.read(1 << 16):
        kept += piece[: _OUTPUT_BYTES - len(kept)]
    return bytes(kept)


async def _steps(process: asyncio.subprocess.Process, told: Told) -> str:
    """The last line that is no progress."""
    assert process.stderr is not None
    said, rest = "", b""
    while piece := await process.stderr.read(1 << 16):
        *lines, rest = (rest + piece).split(b"\n")
        rest = rest[:_LINE_BYTES]  # of a longer line the beginning
        for line in lines:
            step = _step(line)
            if step is None:
                said = _text(line) or said
            else:
                told(*step)
    return _text(rest) or said


def _text(line: bytes) -> str:
    return line.decode(errors="replace").strip()[:_SAID_LETTERS]


def _step(line: bytes) -> tuple[str, float] | None:
    with contextlib.suppress(orjson.JSONDecodeError, KeyError, TypeError, ValueError):
        content = orjson.loads(line)
        return str(content["step"]), min(max(float(content["share"]), 0.0), 1.0)
    return None


def one_line(error: Exception) -> str:
    """What the page says of an error; one that nobody has foreseen goes to the log with its place, too."""
    if isinstance(error, UserError | OSError):
        return str(error)
    _log.error("work of the page failed", exc_info=error)
    return f"unexpected {type(error).__name__}: {(str(error).splitlines() or [''])[0]}; see the log of acqd web"


def without_password(database: str) -> str:
    """The database as an argument of a command; the password of a client's key cannot be handed over otherwise."""
    if "://" not in database:
        return database
    url = sa.make_url(database).difference_update_query(_SECRETS)
    return url._replace(password=None).render_as_string(hide_password=False)


def password_of(database: str) -> dict[str, str]:
    """The password in the environment, where libpq looks for it."""
    if "://" not in database:
        return {}
    url = sa.make_url(database)
    password = url.password or url.query.get("password")
    return {"PGPASSWORD": str(password)} if password else {}
