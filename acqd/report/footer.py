"""Where a report comes from: date, version, command, seed and hashes."""

from __future__ import annotations

import re
import shlex
import sys
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path

_CREDENTIALS = re.compile(r"://[^/@\s]*@")


def provenance(details: dict[str, str]) -> dict[str, str]:
    """Rows of the footer. `details`: seed, inputs and their hashes, as the report knows them."""
    written = datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC")
    return {"written": written, "by": f"acqd {version()}", "command": command(sys.orig_argv), **details}


def version() -> str:
    """Of the installed package."""
    try:
        return metadata.version("acqd")
    except metadata.PackageNotFoundError:
        return "of unknown version"


def command(arguments: list[str]) -> str:
    """The command line of this process, without credentials in URLs."""
    words = [_CREDENTIALS.sub("://", word) for word in arguments[1:]] or ["-"]
    if words[:3] == ["-P", "-m", "acqd"]:  # as a command starts another one
        words = words[2:]
    if Path(words[0]).name == "acqd":
        return shlex.join(["acqd", *words[1:]])
    return shlex.join(["python", *words])
