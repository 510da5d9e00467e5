"""Steps that make something, each done once: what is there already is not made again."""

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
    """Commands (a module and its arguments) whose products tell that they are done."""

    title: str
    products: tuple[Path, ...]
    commands: tuple[tuple[str, ...], ...]
    told: Path | None = None
    """Keeps what the last command prints; one of the products."""

    @property
    def done(self) -> bool:
        return all(product.exists() for product in self.products)


def run(steps: Sequence[Step], out: Path, console: Console) -> None:
    """In turn. Raises OperationError with what a command said when it fails; the next run goes on there."""
    journal = out / _JOURNAL
    took: dict[str, float] = json.loads(journal.read_text()) if journal.exists() else {}
    for number, step in enumerate(steps, start=1):
        label = f"[{number}/{len(steps)}] {step.title}"
        if step.done:
            console.print(f"{label}: there already", highlight=False, markup=False)
            continue
        console.print(f"{label} ...", highlight=False, markup=False)
        begun = time.monotonic()
        for command in step.commands:
            printed = _run(command, out / "steps.log", console)
            if step.told is not None and command == step.commands[-1]:
                write_complete(step.told, printed.encode())
        if not step.done:
            lost = next(product for product in step.products if not product.exists())
            raise OperationError(f"{step.title}: {lost} was not made; see {out / 'steps.log'}")
        took[step.title] = took.get(step.title, 0.0) + time.monotonic() - begun
        write_complete(journal, json.dumps(took, indent=1).encode())


def make_folder(out: Path) -> None:
    """For everything that is made. Raises UserError."""
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"{out}: {error.strerror}; name another folder") from None


def seconds(out: Path) -> dict[str, float]:
    """What each step took."""
    journal = out / _JOURNAL
    return json.loads(journal.read_text()) if journal.exists() else {}


def _run(command: tuple[str, ...], log: Path, console: Console) -> str:
    """What it prints. Its own progress is shown on a terminal; elsewhere what it says of that goes to the log."""
    with log.open("a") as file:
        file.write(f"$ {' '.join(command)}\n")
        file.flush()
        done = run_module(command, stderr=None if console.is_terminal else file)
        file.write(done.stdout)
    if done.returncode:
        last = log.read_text().strip().splitlines()[-1]
        raise OperationError(f"{' '.join(command)} ended with {done.returncode}: {last} (all of it: {log})")
    return done.stdout
