"""Progress of long commands: a bar in a terminal, lines of JSON for a program that asks for them."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager

import orjson
from rich.console import Console
from rich.progress import Progress

PROGRESS_LINES = "ACQD_PROGRESS"
"""Environment variable: "lines" for one JSON object per step, {"step": ..., "share": 0 .. 1}, on stderr."""


@contextmanager
def progress(console: Console) -> Iterator[Callable[[str, float], None]]:
    """A function that takes what is being done and the share that is done."""
    if os.environ.get(PROGRESS_LINES) == "lines":
        yield _line
        return
    with Progress(console=console, transient=True, disable=not console.is_terminal) as bar:
        task = bar.add_task("reading", total=1.0)
        yield lambda step, share: bar.update(task, description=step, completed=share)


def _line(step: str, share: float) -> None:
    sys.stderr.write(orjson.dumps({"step": step, "share": round(share, 4)}).decode() + "\n")
    sys.stderr.flush()
