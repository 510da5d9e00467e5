"""Commands of acqd that another command runs, each in a process of its own, and shows: an engineer can type them.

What is there already is not made again, so that an interrupted run goes on.
"""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import orjson
from rich.console import Console
from rich.progress import Progress

from acqd.atomic import replace_file
from acqd.cli.progress import PROGRESS_LINES, Show, bars
from acqd.errors import OperationError, UserError, no_folder

_REFUSED = 2
"""Exit code of bad input."""


@dataclass(frozen=True, slots=True)
class Step:
    """A command."""

    made: Path
    """A file or folder that is there when the command has been run."""
    words: tuple[str, ...]

    @classmethod
    def of(cls, made: Path, *words: object) -> Step:
        """A command from words of any type."""
        return cls(made, tuple(str(word) for word in words))

    @property
    def line(self) -> str:
        """As it is typed."""
        return shlex.join(["acqd", *self.words])


class Steps:
    """Runs commands in a folder that belongs to one question."""

    def __init__(self, out: Path, console: Console) -> None:
        """`console`: where the commands are shown."""
        self.out = out
        self._console = console
        self.lines: list[str] = []
        """The commands in their order, run or not."""
        self.seconds: dict[str, float] = {}
        """How long each command took, by its line; without those that were not run."""

    def claim(self, name: str, asked: dict[str, Any], what: str) -> None:
        """Write into the file `name` what is asked, so that what is there is not taken for the answer to another.

        `what`: what the folder holds, in words. Raises UserError for a folder that holds something else.
        """
        file, wanted = self.out / name, orjson.dumps(asked, option=orjson.OPT_INDENT_2)
        if file.exists() and file.read_bytes() != wanted:
            raise UserError(f"{self.out} holds another {what} ({name} says which); choose another --out")
        if self.out.exists() and not self.out.is_dir():
            raise UserError(f"{self.out}: {no_folder(self.out)}; choose another --out")
        if self.out.exists() and not file.exists() and any(self.out.iterdir()):
            raise UserError(f"{self.out} is not empty and holds no {what}; choose another --out")
        try:
            self.out.mkdir(parents=True, exist_ok=True)
            replace_file(file, wanted)
        except OSError as error:
            raise UserError(f"{self.out}: cannot be written ({error.strerror}); choose another --out") from None

    def run(self, *steps: Step) -> None:
        """Run commands that do not need each other, at the same time; those whose result is there are not run.

        Raises UserError, OperationError with the line of the command that failed.
        """
        self.lines += [step.line for step in steps]
        to_do = [step for step in steps if not step.made.exists()]
        if not to_do:
            return
        for step in to_do:
            self._console.print(step.line, soft_wrap=True, highlight=False, markup=False)
        with bars(self._console) as shown, ThreadPoolExecutor(len(to_do)) as pool:
            for done in [pool.submit(self._run, step, shown) for step in to_do]:
                done.result()

    def _run(self, step: Step, shown: Progress) -> None:
        task = shown.add_task(step.words[0], total=1.0)

        def show(what: str, share: float) -> None:
            shown.update(task, description=f"{step.words[0]}: {what}", completed=share)

        started = time.monotonic()
        code, said = run_command([*step.words, "--json"], show)
        if code:
            raise (UserError if code == _REFUSED else OperationError)(f"acqd {step.words[0]}: {said}")
        self.seconds[step.line] = time.monotonic() - started


def run_command(words: list[str], show: Show) -> tuple[int, str]:
    """Exit code and last line of a command of acqd; `show` gets its progress."""
    said = "no message"
    with subprocess.Popen(
        [sys.executable, "-P", "-m", "acqd", *words],
        stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, env=os.environ | {PROGRESS_LINES: "lines"},
    ) as process:  # fmt: skip
        assert process.stderr is not None
        for line in process.stderr:
            told = _progress_of(line)
            if told is not None:
                show(*told)
            elif line.strip():
                said = line.strip().removeprefix("acqd: ")
    return process.returncode, said


def _progress_of(line: str) -> tuple[str, float] | None:
    if not line.startswith('{"step":'):
        return None
    try:
        told = orjson.loads(line)
        return str(told["step"]), float(told["share"])
    except (ValueError, KeyError, TypeError):
        return None
