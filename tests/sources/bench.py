"""A source and the double of its device, driven by one virtual clock: what the contract test needs of each kind."""

from __future__ import annotations

import re
import socket
from abc import ABC, abstractmethod
from collections.abc import Callable
from contextlib import ExitStack

import numpy as np

from acqd.errors import UserError
from acqd.metering import SampleBlock
from acqd.sources.device import DeviceSource
from tests.waiting import wait_for

START_NS = 10**18


class VirtualClock:
    """Nanoseconds that pass only when told to."""

    def __init__(self) -> None:
        self.now = 10**12

    def __call__(self) -> int:
        return self.now


def wait_until_reachable(host: str, port: int) -> None:
    """The double listens again in its own time, not in the virtual one."""

    def answers() -> bool:
        with socket.socket() as probe:
            return probe.connect_ex((host, port)) == 0

    wait_for(answers, f"{host}:{port} listens")


_LOST_REPLIES = re.compile(
    "mailbox does not answer|does not reach|does not say what it is|its objects say|cannot be mapped|did not keep"
)


def connect_patiently(source: DeviceSource) -> None:
    """Connect to a double, which a busy machine keeps from the processor for longer than SOEM waits for a terminal."""
    for attempt in range(20):
        try:
            source.connect()
        except UserError as error:
            if attempt == 19 or not _LOST_REPLIES.search(str(error)):
                raise
        else:
            return


class Tape:
    """Everything a source delivered."""

    def __init__(self) -> None:
        self.blocks: list[SampleBlock] = []

    def add(self, block: SampleBlock) -> None:
        if self.blocks:
            last = self.blocks[-1]
            assert block.index >= last.index + len(last.codes), "samples repeat or go back"
        self.blocks.append(block)

    @property
    def index(self) -> np.ndarray:
        return np.concatenate([block.index + np.arange(len(block.codes)) for block in self.blocks])

    @property
    def lost(self) -> int:
        """Samples missing between the first and the last."""
        return int(self.index[-1] - self.index[0] + 1 - len(self.index))

    def flagged(self, flag: str) -> int:
        return sum(len(block.codes) for block in self.blocks if flag in block.flags)

    def offset(self, codes: Callable[[int, int], np.ndarray], most: int) -> int:
        """Device number of stream sample 0: every sample must be the device's own, at one offset for all."""
        first = self.blocks[0]
        length = min(len(first.codes), 200)
        table = codes(0, most + length)
        columns = table[:, 0].astype(np.int64)
        starts = np.flatnonzero(columns[:most] == first.codes[0, 0])
        found = [k for k in starts if np.array_equal(table[k : k + length], first.codes[:length])]
        assert len(found) == 1, f"the first block is at {found} of the device's samples"
        offset = int(found[0]) - first.index
        for block in self.blocks:
            np.testing.assert_array_equal(block.codes, codes(block.index + offset, len(block.codes)))
        return offset


class Bench(ABC):
    """One kind of source at its double."""

    source: DeviceSource
    step_samples: int
    """What the device samples between two exchanges."""
    search: int = 60_000
    """Among how many of the device's samples the first delivered one is."""
    keeps_count = True
    """A lost connection leaves the device's sample counter alone."""

    def __init__(self, stack: ExitStack) -> None:
        self.clock = VirtualClock()
        self.tape = Tape()
        self.build(stack)
        stack.callback(self.source.close)

    @abstractmethod
    def build(self, stack: ExitStack) -> None: ...

    def connect(self) -> None:
        connect_patiently(self.source)

    @abstractmethod
    def codes(self, first: int, count: int) -> np.ndarray: ...

    def open(self, index: int = 0) -> None:
        self.source.open(START_NS, index)

    def advance(self) -> None:
        """Time passes, the device samples."""
        self.clock.now += round(self.step_samples * 1e9 / self.source.form.rate)

    def step(self, times: int = 1, limit: int = 100_000) -> None:
        for _ in range(times):
            self.advance()
            self.source.exchange()
            self.drain(limit)

    def drain(self, limit: int = 100_000) -> None:
        while len((block := self.source.read(limit)).codes):
            self.tape.add(block)

    def until(self, condition: Callable[[], bool], times: int = 3_000) -> None:
        for _ in range(times):
            if condition():
                return
            self.step()
        raise AssertionError(f"not within {times} steps; health: {self.source.health()}")

    @abstractmethod
    def lose(self) -> int:
        """The device, or the wire, loses samples; how many."""

    @abstractmethod
    def over_range(self, on: bool) -> None: ...

    @abstractmethod
    def disconnect(self) -> None:
        """The device is out of reach from now on."""

    @abstractmethod
    def pass_time(self, seconds: float) -> None:
        """Meanwhile, the device samples on."""

    @abstractmethod
    def reconnect(self) -> None: ...

    @abstractmethod
    def restart(self) -> None:
        """The device loses its supply for a moment: its counters start over."""
