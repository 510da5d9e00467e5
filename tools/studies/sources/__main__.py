"""Runs minutes of samples through every device source in lockstep with its double: no sample lost or repeated.

    python -m tools.studies.sources --minutes 10

Time is virtual: the double samples as fast as it is read, so the result does not depend on this computer's load. Every
sample is compared bit by bit with the double's sample. With faults, every gap must be as long as the loss.
"""

from __future__ import annotations

import json as json_
import random
import time
from collections.abc import Callable
from contextlib import ExitStack
from dataclasses import asdict, dataclass
from functools import partial
from typing import Annotated

import numpy as np
import typer
from rich.console import Console
from rich.progress import Progress, TaskID
from rich.table import Table

from acqd.cli.main import for_people
from acqd.errors import UserError
from acqd.metering import SampleBlock
from tests.doubles.veth import may_create_veth
from tests.sources.bench import Bench
from tests.sources.benches import KINDS, EthercatBench
from tools.common.tables import show, verdict

_FAULT_EVERY = 400  # steps


class BlockwiseEthercatBench(EthercatBench):
    """Blocks of 100 samples, read four times each."""

    oversampling, step_samples, advance_ns = 100, 25, 1_250_000

    def lose(self) -> int:
        """Depending on its place in a block, a loss may cost one block more: the double counts the blocks it sent."""
        missing = self._missing()
        super().lose()
        self.step()
        return self._missing() - missing

    def _missing(self) -> int:
        stats = self.double.stats()
        return self.oversampling * int(stats["last_block"] - stats["first_block"] + 1 - stats["blocks_sent"])


_KINDS: dict[str, type[Bench]] = {"ethercat N=20": KINDS["ethercat"], "ethercat N=100": BlockwiseEthercatBench}
_KINDS |= {name: kind for name, kind in KINDS.items() if name != "ethercat"}


@dataclass(slots=True)
class Result:
    """One source, with or without faults."""

    source: str
    faults: bool
    minutes: float
    samples: int = 0
    gaps: int = 0
    """Samples missing in the stream."""
    lost: int = 0
    """Samples that the double lost on purpose."""
    wrong: int = 0
    """Samples that differ from the double's."""
    repeated: int = 0
    times_real: float = 0.0

    @property
    def good(self) -> bool:
        """Every sample once, every loss a gap."""
        return self.samples > 0 and self.gaps == self.lost and not self.wrong and not self.repeated


class Check:
    """Compares a stream with the double's samples, block by block."""

    def __init__(self, bench: Bench, result: Result) -> None:
        self._bench, self._result = bench, result
        self._offset: int | None = None
        self._next = 0

    def add(self, block: SampleBlock) -> None:
        """Compare the next block."""
        count, result = len(block.codes), self._result
        if self._offset is None:
            self._offset, self._next = self._locate(block), block.index
        result.repeated += max(0, self._next - block.index)
        result.gaps += max(0, block.index - self._next)
        expected = self._bench.codes(block.index + self._offset, count)
        result.wrong += int((block.codes != expected).any(axis=1).sum())
        result.samples += count
        self._next = block.index + count

    def _locate(self, block: SampleBlock) -> int:
        table = self._bench.codes(0, self._bench.search)
        count = len(block.codes)
        for start in np.flatnonzero(table[: -count or None, 0] == block.codes[0, 0]):
            if np.array_equal(table[start : start + count], block.codes):
                return int(start) - block.index
        raise UserError("the first block is not among the double's samples")


def campaign(
    minutes: Annotated[float, typer.Option(min=0.01, help="Minutes of samples for each source.")] = 10.0,
    only: Annotated[list[str] | None, typer.Option(help=f"Sources: {', '.join(_KINDS)}.")] = None,
    seed: Annotated[int, typer.Option(help="Seed of the faults.")] = 2026,
    json: Annotated[bool, typer.Option("--json", help="Machine-readable output on stdout.")] = False,
) -> None:
    """Run every source in lockstep with its double, without and with faults.

    Example: python -m tools.studies.sources --minutes 1 --only ads
    """
    unknown = set(only or []) - set(_KINDS)
    if unknown:
        raise UserError(f"--only {sorted(unknown)[0]!r}: expected one of {', '.join(_KINDS)}")
    if not may_create_veth():
        raise UserError("the doubles of EtherCAT and sampled values need veth pairs: run as root")
    console = Console(stderr=True)
    results = []
    with Progress(console=console, disable=not console.is_terminal) as progress:
        for name in only or _KINDS:
            for faults in (False, True):
                bar = progress.add_task(f"{name}{', faults' if faults else ''}", total=minutes)
                results.append(_run(name, minutes, faults, seed, partial(_show, progress, bar)))
    if json:
        print(json_.dumps([asdict(result) | {"good": result.good} for result in results]))
    else:
        show(_table(results), width=130)
    raise SystemExit(0 if all(result.good for result in results) else 1)


def _show(progress: Progress, bar: TaskID, done: float) -> None:
    progress.update(bar, completed=done)


def _run(name: str, minutes: float, faults: bool, seed: int, progress: Callable[[float], None]) -> Result:
    result = Result(name, faults, minutes)
    chance = random.Random(seed)
    with ExitStack() as stack:
        bench = _KINDS[name](stack)
        bench.connect()
        bench.open()
        bench.tape = Check(bench, result)  # type: ignore[assignment]
        goal, begun, step = minutes * 60 * bench.source.form.rate, time.perf_counter(), 0
        while result.samples < goal:
            bench.step()
            step += 1
            if faults and result.samples and step % _FAULT_EVERY == 0:
                _disturb(bench, result, chance)
            if step % 500 == 0:
                progress(result.samples / bench.source.form.rate / 60)
        if faults:
            bench.step(_FAULT_EVERY // 4)  # the last loss shows with the next samples
        result.times_real = minutes * 60 / (time.perf_counter() - begun)
    return result


def _disturb(bench: Bench, result: Result, chance: random.Random) -> None:
    """Lose samples, or set a moment of over-range, which must not cost any."""
    if chance.random() < 0.7:
        result.lost += bench.lose()
    else:
        bench.over_range(True)
        bench.step()
        bench.over_range(False)


def _table(results: list[Result]) -> Table:
    table = Table("source", "faults", "samples", "lost by the double", "gaps", "wrong", "repeated", "x real time", "")
    for result in results:
        numbers = (result.samples, result.lost, result.gaps, result.wrong, result.repeated)
        shown = [f"{number:,}" for number in numbers]
        exact = verdict(result.good, "exact", "NOT EXACT")
        table.add_row(result.source, "yes" if result.faults else "no", *shown, f"{result.times_real:.1f}", exact)
    return table


if __name__ == "__main__":
    app = typer.Typer(pretty_exceptions_enable=False, add_completion=False)
    app.command()(campaign)
    for_people(app)
