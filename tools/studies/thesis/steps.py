"""Steps that produce files. A step whose files exist is not repeated."""

from __future__ import annotations

import json
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from rich.console import Console

from acqd.atomic import write_complete
from acqd.errors import OperationError, UserError
from tools.common.commands import run_module

_JOURNAL = "steps.json"


@dataclass(frozen=True, slots=True)
class Step:
    """Commands and the files that they produce."""

    title: str
    products: tuple[Path, ...]
    commands: tuple[tuple[str, ...], ...]
    """Each a module and its arguments."""
    output: Path | None = None
    """File for the output of the last command; one of the products."""

    @property
    def done(self) -> bool:
        """Whether all products exist."""
        return all(product.exists() for product in self.products)


def run(steps: Sequence[Step], out: Path, console: Console) -> None:
    """Run all steps in turn; a later call continues after the last complete one.

    Raises OperationError with the last message of a command that fails.
    """
    journal = out / _JOURNAL
    took: dict[str, float] = json.loads(journal.read_text()) if journal.exists() else {}
    for number, step in enumerate(steps, start=1):
        label = f"[{number}/{len(steps)}] {step.title}"
        if step.done:
            console.print(f"{label}: already done", highlight=False, markup=False)
            continue
        console.print(f"{label} ...", highlight=False, markup=False)
        started = time.monotonic()
        for command in step.commands:
            printed = _run(command, out / "steps.log", console)
            if step.output is not None and command == step.commands[-1]:
                write_complete(step.output, printed.encode())
        if not step.done:
            missing = next(product for product in step.products if not product.exists())
            raise OperationError(f"{step.title}: {missing} was not made; see {out / 'steps.log'}")
        took[step.title] = took.get(step.title, 0.0) + time.monotonic() - started
        write_complete(journal, json.dumps(took, indent=1).encode())


def make_folder(out: Path) -> None:
    """Make the folder of all results. Raises UserError."""
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"{out}: {error.strerror}; name another folder") from None


def seconds(out: Path) -> dict[str, float]:
    """Run time of each step by title."""
    journal = out / _JOURNAL
    return json.loads(journal.read_text()) if journal.exists() else {}


def _run(command: tuple[str, ...], log: Path, console: Console) -> str:
    """Run a command and return its output; its progress goes to the terminal, or else to the log."""
    with log.open("a") as file:
        file.write(f"$ {' '.join(command)}\n")
        file.flush()
        done = run_module(command, stderr=None if console.is_terminal else file)
        file.write(done.stdout)
    if done.returncode:
        last = log.read_text().strip().splitlines()[-1]
        raise OperationError(f"{' '.join(command)} failed with exit code {done.returncode}: {last} (see {log})")
    return done.stdout
