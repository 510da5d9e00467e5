"""Many inputs to one parser, in a process with limits of time and memory; a process that dies is a finding, too."""

from __future__ import annotations

import multiprocessing
import random
import resource
import signal
import warnings
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path

from tools.studies.fuzz.judge import Outcome, outcome
from tools.studies.fuzz.mutate import Files, mutated
from tools.studies.fuzz.seeds import as_zip
from tools.studies.fuzz.targets import target

_REPORT_EVERY = 200
_KEPT = 3  # inputs of each failure


@dataclass(frozen=True, slots=True)
class Limits:
    """What one input may take."""

    seconds: float = 5.0
    memory_bytes: int = 4 << 30
    """Address space of the process, with the libraries."""


@dataclass(slots=True)
class Tally:
    """What became of the inputs of one parser."""

    parser: str
    inputs: int = 0
    accepted: int = 0
    refused: int = 0
    failures: Counter[str] = field(default_factory=Counter)
    """How many inputs ended in each way that none may end in."""


@dataclass(slots=True)
class _Progress:
    """What a process tells: inputs done so far, and the failure of the next one if it has one."""

    number: int
    accepted: int
    refused: int
    failure: str = ""


def input_of(name: str, seed: int, number: int, seeds: list[Files]) -> Files:
    """The input of a number: the same in every run."""
    chance = random.Random(f"{name} {seed} {number}")
    return mutated(chance.choice(seeds), seeds, chance)


def run_parser(
    name: str, seed: int, count: int, limits: Limits, keep: Path | None, progress: Callable[[int], None]
) -> Tally:
    """`count` inputs of one parser; inputs that fail are kept in the folder `keep`."""
    tally, seeds = Tally(name), target(name).seeds()
    first = 0
    while first < count:
        receiver, sender = multiprocessing.Pipe(duplex=False)
        context = multiprocessing.get_context("spawn")  # a fork would inherit the limits and threads of this process
        process = context.Process(target=_work, args=(sender, name, seed, first, count, limits))
        process.start()
        sender.close()
        first = _follow(
            receiver,
            tally,
            first,
            lambda failure, number: _keep(keep, tally, failure, name, number, input_of(name, seed, number, seeds)),
            progress,
        )
        process.join()
        if process.exitcode:
            number = first
            _keep(
                keep,
                tally,
                f"the process ended with {_ending(process.exitcode)}",
                name,
                number,
                input_of(name, seed, number, seeds),
            )
            first += 1
            tally.inputs = first
    return tally


def _follow(
    receiver: Connection, tally: Tally, first: int, failed: Callable[[str, int], None], progress: Callable[[int], None]
) -> int:
    """Counts until the process is done or dead; the number of the input that it was at."""
    accepted, refused, number = tally.accepted, tally.refused, first
    while True:
        try:
            told: _Progress = receiver.recv()
        except EOFError:
            return number
        if told.failure:
            failed(told.failure, told.number - 1)
        tally.accepted, tally.refused = accepted + told.accepted, refused + told.refused
        tally.inputs = number = told.number
        progress(number)


def _work(sender: Connection, name: str, seed: int, first: int, count: int, limits: Limits) -> None:
    warnings.simplefilter("ignore")
    parser = target(name)
    seeds = parser.seeds()
    for files in seeds:
        outcome(parser, files, 60.0)  # imports take time and memory of their own
    resource.setrlimit(resource.RLIMIT_AS, (limits.memory_bytes, limits.memory_bytes))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    accepted = refused = 0
    for number in range(first, count):
        end: Outcome = outcome(parser, input_of(name, seed, number, seeds), limits.seconds)
        accepted += end.kind == "accepted"
        refused += end.kind == "refused"
        if end.kind == "failure":
            sender.send(_Progress(number + 1, accepted, refused, end.reason))
        elif (number + 1) % _REPORT_EVERY == 0 or number + 1 == count:
            sender.send(_Progress(number + 1, accepted, refused))


def _keep(keep: Path | None, tally: Tally, failure: str, name: str, number: int, files: Files) -> None:
    tally.failures[failure] += 1
    if keep is not None and tally.failures[failure] <= _KEPT:
        (keep / f"{name}-{number}.zip").write_bytes(as_zip(files))


def _ending(code: int) -> str:
    return signal.Signals(-code).name if code < 0 else f"exit code {code}"
