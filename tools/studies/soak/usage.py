"""What a process and its children hold: resident memory, descriptors, threads."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from tools.studies.faults.process import Process


@dataclass(frozen=True, slots=True)
class Usage:
    """Of a process tree."""

    rss: int
    """Resident memory, pages shared between them counted for each [bytes]."""
    descriptors: int
    threads: int


def usage(pid: int) -> Usage | None:
    """What the process and its children hold now; None when it has ended."""
    parts = [part for each in _tree(pid) if (part := _one(each)) is not None]
    if not parts:
        return None
    return Usage(sum(p.rss for p in parts), sum(p.descriptors for p in parts), sum(p.threads for p in parts))


def _tree(pid: int) -> Iterator[int]:
    yield pid
    with suppress(OSError):
        for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split():
            yield from _tree(int(child))


def _one(pid: int) -> Usage | None:
    place = Path(f"/proc/{pid}")
    try:
        fields = dict(line.split(":", 1) for line in (place / "status").read_text().splitlines())
        descriptors = len(list((place / "fd").iterdir()))
        return Usage(int(fields["VmRSS"].split()[0]) * 1024, descriptors, int(fields["Threads"]))
    except (OSError, KeyError):  # ended, or a zombie
        return None


@dataclass(frozen=True, slots=True)
class Sample:
    """What a service held at a moment."""

    at_s: float
    """Since the sampler's start."""
    name: str
    usage: Usage
    log_lines: int
    stored: int
    """Size of the files that it keeps [bytes]."""


class Sampler:
    """Samples services in a thread."""

    def __init__(
        self, services: Mapping[str, Process], every_s: float, stored: Mapping[str, Callable[[], int]]
    ) -> None:
        """`stored`: the bytes on disk of some services."""
        self._services, self._every_s, self._stored = services, every_s, stored
        self._begun, self._stopped = time.monotonic(), threading.Event()
        self.samples: list[Sample] = []
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    @property
    def elapsed_s(self) -> float:
        """Time since the start, in the clock of the samples."""
        return time.monotonic() - self._begun

    def of(self, name: str, from_s: float = 0.0) -> list[Sample]:
        """The samples of a service from a moment on."""
        return [sample for sample in list(self.samples) if sample.name == name and sample.at_s >= from_s]

    def stop(self) -> None:
        """End the thread."""
        self._stopped.set()
        self._thread.join()

    def _run(self) -> None:
        while not self._stopped.wait(self._every_s):
            for name, process in self._services.items():
                running = process.running
                now = usage(running.pid) if running is not None else None
                if now is not None:
                    bytes_ = self._stored[name]() if name in self._stored else 0
                    self.samples.append(Sample(self.elapsed_s, name, now, _lines(process.log), bytes_))


def _lines(path: Path) -> int:
    try:
        with path.open("rb") as file:
            return sum(piece.count(b"\n") for piece in iter(lambda: file.read(1 << 16), b""))
    except OSError:
        return 0


def folder_size(folder: Path, pattern: str) -> int:
    """Size of the files in a folder that match [bytes]."""
    total = 0
    for path in folder.glob(pattern):
        with suppress(OSError):
            total += path.stat().st_size
    return total
