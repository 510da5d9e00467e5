"""The command `acqd` as a user types it, in a process of its own."""

from __future__ import annotations

import contextlib
import io
import logging
import os
import subprocess
import sys
from contextlib import ExitStack, redirect_stderr, redirect_stdout
from pathlib import Path
from unittest import mock

from acqd.cli.main import main

ACQD = [sys.executable, "-P", "-m", "acqd"]
"""-P: a file in the working folder must not shadow a module."""


def acqd(*arguments: object, cwd: object = None, **environment: str) -> subprocess.CompletedProcess[str]:
    """Run to the end; bad input or not, no user ever sees a traceback."""
    done = subprocess.run(
        [*ACQD, *map(str, arguments)],
        cwd=cwd,
        capture_output=True,
        text=True,
        check=False,
        env=os.environ | {"OMP_NUM_THREADS": "1", "COLUMNS": "200"} | environment,
    )
    assert "Traceback" not in done.stderr, done.stderr
    return done


def acqd_here(*arguments: object, cwd: Path | None = None) -> subprocess.CompletedProcess[str]:
    """The same in this process, without seconds of imports: arguments, output, log lines and exit status are real."""
    out, err, code = io.StringIO(), io.StringIO(), 0
    with ExitStack() as stack:
        stack.callback(setattr, logging.root, "handlers", logging.root.handlers)
        stack.callback(logging.root.setLevel, logging.root.level)
        logging.root.handlers = []  # so that the command sets its own
        stack.callback(setattr, sys, "argv", sys.argv)
        sys.argv = ["acqd", *map(str, arguments)]
        stack.enter_context(mock.patch.dict(os.environ, COLUMNS="200"))
        for change in (contextlib.chdir(cwd or Path.cwd()), redirect_stdout(out), redirect_stderr(err)):
            stack.enter_context(change)
        try:
            main()
        except SystemExit as end:
            code = end.code if isinstance(end.code, int) else int(end.code is not None)
    return subprocess.CompletedProcess(arguments, code, out.getvalue(), err.getvalue())


def start(*arguments: object, cwd: object = None) -> subprocess.Popen[str]:
    """Start and leave running."""
    return subprocess.Popen(
        [*ACQD, *map(str, arguments)], cwd=cwd, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


def refused(result: subprocess.CompletedProcess[str]) -> str:
    """The one line that a command prints when it refuses its input with exit status 2."""
    assert result.returncode == 2, result.stderr
    lines = result.stderr.strip().splitlines()
    assert len(lines) == 1 and lines[0].startswith("acqd: "), result.stderr
    return lines[0]
