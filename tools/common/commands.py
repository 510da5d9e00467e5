"""Runs acqd's commands as a user would: in a separate process of the same interpreter, with one clear error.

The process is not started with `-P`: it imports acqd from the same source tree as the tool that calls it.
"""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Sequence
from typing import IO, Any

from acqd.errors import OperationError


def acqd_command(*arguments: object) -> list[str]:
    """The command line of `acqd ARGUMENTS`, for processes that run in the background."""
    return [sys.executable, "-m", "acqd", *map(str, arguments)]


def acqd(*arguments: object) -> str:
    """What `acqd ARGUMENTS` prints. Raises OperationError with the command and its message when it fails."""
    done = run_module(["acqd", *map(str, arguments)])
    if done.returncode:
        raise OperationError(
            f"acqd {' '.join(map(str, arguments))} ended with {done.returncode}: {done.stderr.strip() or 'no message'}"
        )
    return done.stdout


def acqd_json(*arguments: object) -> Any:
    """The report that `acqd ARGUMENTS --json` prints. Raises OperationError like `acqd`."""
    return json.loads(acqd(*arguments, "--json"))


def run_module(
    command: Sequence[str], stderr: IO[str] | int | None = subprocess.PIPE
) -> subprocess.CompletedProcess[str]:
    """Run `python -m COMMAND` to its end and keep what it prints.

    `stderr`: captured by default; None leaves it on the terminal, a file collects it.
    """
    return subprocess.run(
        [sys.executable, "-m", *command], stdout=subprocess.PIPE, stderr=stderr, text=True, check=False
    )
