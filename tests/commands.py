"""The command `acqd` as a user types it, in a process of its own."""

from __future__ import annotations

import contextlib
import io
import logging
import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager, redirect_stderr, redirect_stdout
from importlib import import_module
from pathlib import Path
from typing import IO, Any
from unittest import mock

from acqd.cli.main import for_people, main

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
    return _here(main, ["acqd", *map(str, arguments)], cwd or Path.cwd())


def module_here(command: Sequence[str], stderr: IO[str] | None = None) -> subprocess.CompletedProcess[str]:
    """What `tools.common.commands.run_module` does, in this process."""
    module, *arguments = command
    if module == "acqd":
        done = acqd_here(*arguments)
    else:
        program = import_module(f"{module}.__main__").main
        done = _here(lambda: for_people(program), [module, *arguments], Path.cwd())
    if stderr is not None:
        stderr.write(done.stderr)
    return done


def _here(program: Callable[[], None], argv: list[str], cwd: Path) -> subprocess.CompletedProcess[str]:
    out, err, code = io.StringIO(), io.StringIO(), 0
    with ExitStack() as stack:
        stack.callback(setattr, logging.root, "handlers", logging.root.handlers)
        stack.callback(logging.root.setLevel, logging.root.level)
        logging.root.handlers = []  # so that the command sets its own
        stack.callback(setattr, sys, "argv", sys.argv)
        sys.argv = argv
        stack.enter_context(mock.patch.dict(os.environ, COLUMNS="200"))
        for change in (contextlib.chdir(cwd), redirect_stdout(out), redirect_stderr(err)):
            stack.enter_context(change)
        try:
            program()
        except SystemExit as end:
            code = end.code if isinstance(end.code, int) else int(end.code is not None)
    return subprocess.CompletedProcess(argv[1:], code, out.getvalue(), err.getvalue())


@contextmanager
def without_workers() -> Iterator[None]:
    """Campaigns and trainings run one after the other in this process: every worker would import for seconds."""
    import acqd.fleet.run
    import acqd.lab.campaign.run  # before their copies of the name are replaced
    import acqd.workers  # noqa: F401

    with ExitStack() as stack:
        for module in ("acqd.workers", "acqd.lab.campaign.run", "acqd.fleet.run"):
            stack.enter_context(mock.patch(f"{module}.run_here", _in_turn))
        yield


def _in_turn(work: Callable[[Any], Any], tasks: list[Any], jobs: int, tick: Callable[[], None]) -> Iterator[Any]:
    for task in tasks:
        yield work(task)
        tick()


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
