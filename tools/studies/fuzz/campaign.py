"""Many inputs to one parser, in a process with limits of time and memory; a process that dies is a finding, too."""

from __future__ import annotations

import io
import multiprocessing
import random
import resource
import signal
import warnings
import zipfile
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from tools.studies.fuzz.judge import Outcome, outcome
from tools.studies.fuzz.memory import Peak
from tools.studies.fuzz.mutate import Files, mutated
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

    def as_json(self) -> dict[str, Any]:
        """The figures by name."""
        return {
            "parser": self.parser,
            "inputs": self.inputs,
            "accepted": self.accepted,
            "refused": self.refused,
            "failures": dict(self.failures),
        }


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
    campaign = _Campaign(Tally(name), seed, keep, progress)
    while campaign.tally.inputs < count:
        receiver, sender = multiprocessing.Pipe(duplex=False)
        context = multiprocessing.get_context("spawn")  # a fork would inherit the limits and threads of this process
        process = context.Process(target=_work, args=(sender, name, seed, campaign.tally.inputs, count, limits))
        process.start()
        sender.close()
        campaign.follow(receiver)
        process.join()
        if process.exitcode:
            campaign.fail(campaign.tally.inputs, f"the process ended with {_ending(process.exitcode)}")
            campaign.tally.inputs += 1
    return campaign.tally


@dataclass(slots=True)
class _Campaign:
    """One parser's campaign, over the lives of several processes."""

    tally: Tally
    seed: int
    keep: Path | None
    progress: Callable[[int], None]

    def follow(self, receiver: Connection) -> None:
        """Counts until the process is done or dead."""
        tally, accepted, refused = self.tally, self.tally.accepted, self.tally.refused
        while True:
            try:
                told: _Progress = receiver.recv()
            except EOFError:
                return
            if told.failure:
                self.fail(told.number - 1, told.failure)
            tally.accepted, tally.refused, tally.inputs = accepted + told.accepted, refused + told.refused, told.number
            self.progress(told.number)

    def fail(self, number: int, failure: str) -> None:
        """Counts a failure and keeps the first inputs that end so."""
        self.tally.failures[failure] += 1
        if self.keep is not None and self.tally.failures[failure] <= _KEPT:
            seeds = target(self.tally.parser).seeds()
            files = input_of(self.tally.parser, self.seed, number, seeds)
            (self.keep / f"{self.tally.parser}-{number}.zip").write_bytes(_as_zip(files))


def _work(sender: Connection, name: str, seed: int, first: int, count: int, limits: Limits) -> None:
    warnings.simplefilter("ignore")
    parser = target(name)
    seeds = parser.seeds()
    for files in seeds:
        outcome(parser, files, 60.0)  # imports take time and memory too
    resource.setrlimit(resource.RLIMIT_AS, (limits.memory_bytes, limits.memory_bytes))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    accepted, refused, peak = 0, 0, Peak()
    for number in range(first, count):
        files = input_of(name, seed, number, seeds)
        end: Outcome = outcome(parser, files, limits.seconds)
        if (reason := peak.excess(files)) and end.kind != "failure":
            end = Outcome("failure", reason)
        accepted += end.kind == "accepted"
        refused += end.kind == "refused"
        if end.kind == "failure":
            sender.send(_Progress(number + 1, accepted, refused, end.reason))
        elif (number + 1) % _REPORT_EVERY == 0 or number + 1 == count:
            sender.send(_Progress(number + 1, accepted, refused))


def _ending(code: int) -> str:
    return signal.Signals(-code).name if code < 0 else f"exit code {code}"


def _as_zip(files: Files) -> bytes:
    """The files as one archive, to keep an input that fails."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return buffer.getvalue()
