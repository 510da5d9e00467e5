"""Progress of long commands: a bar in a terminal, a line now and then in a log file, JSON for a program that asks."""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TypeAlias

import orjson
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

PROGRESS_LINES = "ACQD_PROGRESS"
"""Environment variable: "lines" for one JSON object per step, {"step": ..., "share": 0 .. 1}, on stderr."""
_EVERY_S = 30.0
"""Between lines of a log file: a command that is quick, or fails at once, writes none."""
Show: TypeAlias = Callable[[str, float], None]
"""Takes what is being done, and the share that is done, 0 to 1."""


@contextmanager
def progress(console: Console) -> Iterator[Show]:
    """A function that shows the progress of one command."""
    if os.environ.get(PROGRESS_LINES) == "lines":
        yield _line
    elif not console.is_terminal:
        yield _now_and_then(console)
    else:
        with bars(console) as bar:
            task = bar.add_task("reading", total=1.0)
            yield lambda step, share: bar.update(task, description=step, completed=share)


def bars(console: Console) -> Progress:
    """The bars of a terminal, each with its time; they vanish at the end."""
    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn())
    return Progress(*columns, console=console, transient=True, disable=not console.is_terminal)


def _line(step: str, share: float) -> None:
    sys.stderr.write(orjson.dumps({"step": step, "share": round(share, 4)}).decode() + "\n")
    sys.stderr.flush()


def _now_and_then(console: Console) -> Show:
    started = last = time.monotonic()

    def show(step: str, share: float) -> None:
        nonlocal last
        now = time.monotonic()
        if now - last >= _EVERY_S:
            last = now
            console.print(f"acqd: {step}, {100 * share:.0f} % after {now - started:.0f} s")

    return show
