"""A device whose newest blocks lie in a ring that is read over a network: reconnection, silence, what to fetch."""

from __future__ import annotations

import time
from abc import abstractmethod
from typing import Generic, Protocol, TypeVar

from acqd.errors import UserError
from acqd.metering.block import Codes
from acqd.retry import Backoff
from acqd.sources.device import Clock, DeviceSource

_SILENCE_NS = 500_000_000
_SAFE = 0.125  # share of the ring that the device may write over before our read arrives
_POLLS = 4  # of the ring's duration at least


class DeviceError(Exception):
    """The device cannot be read now; one line. Worth another try later."""


class Client(Protocol):
    """A connection."""

    def close(self) -> None:
        """Drop it."""


ClientT = TypeVar("ClientT", bound=Client)


class RemoteRing(DeviceSource, Generic[ClientT]):
    """Reads the blocks that are new at each exchange."""

    title: str
    """What messages call the device."""

    def __init__(self, poll_ms: int, clock: Clock = time.monotonic_ns) -> None:
        super().__init__(clock)
        self.period_ns = poll_ms * 1_000_000
        self._client: ClientT | None = None
        self._backoff = Backoff()
        self._next: int | None = None  # number of the block to fetch next; None: start with the newest
        self._boot: int | None = None
        self._placed_ns = 0  # when samples came last
        self._slack_ns = 0  # of the last look at the ring: how long the answer took

    def connect(self) -> None:
        """Find the ring. Raises UserError."""
        try:
            self._client = self._make_client()
            self._learn(self._client)
        except (DeviceError, UserError) as error:
            self.close()
            raise UserError(f"{self.title}: {error}") from None

    def open(self, utc_ns: int, index: int = 0) -> None:
        """Start with the newest block."""
        super().open(utc_ns, index)
        self._placed_ns = self._clock()

    def exchange(self) -> None:
        """Fetch the new blocks, or try to connect again."""
        now = self._clock()
        try:
            if self._client is None:
                if not self._backoff.due(now):
                    return
                self._client = self._make_client()
                self._recognise(self._client)
                self._placed_ns = self._clock()
            self._fetch(self._client)
            if self._clock() - self._placed_ns > _SILENCE_NS:
                raise DeviceError(f"no whole samples for 0.5 s: {self._why_silent(self._client)}")
        except (DeviceError, UserError) as error:
            self.close()
            self._lose(f"{self.title}: {error}")

    def close(self) -> None:
        """Drop the connection."""
        if self._client is not None:
            self._client.close()
            self._client = None

    @abstractmethod
    def _make_client(self) -> ClientT:
        """Connect. Raises DeviceError, or UserError for what only the user can change."""

    @abstractmethod
    def _learn(self, client: ClientT) -> None:
        """Read what the ring holds and declare the stream's format. Raises like `_make_client`."""

    def _recognise(self, client: ClientT) -> None:
        """Raise UserError unless this is the ring that was learned."""

    @abstractmethod
    def _fetch(self, client: ClientT) -> None:
        """Queue the blocks that are new. Raises like `_make_client`."""

    @abstractmethod
    def _why_silent(self, client: ClientT) -> str:
        """What to check when samples stay away although the device answers. Raises like `_make_client`."""

    def _timed(self, begun: int) -> int:
        """Now, after an answer that was asked for at `begun`: the device looked at its ring in between."""
        now = self._clock()
        self._slack_ns = now - begun
        return now

    def _deliver(self, codes: Codes, counter: int, taken_ns: int, flags: frozenset[str]) -> None:
        """Queue samples; the ring lives."""
        self._place(codes, counter, taken_ns, flags, self._slack_ns)
        self._placed_ns = self._clock()
        self._backoff.reset()

    def _check_poll(self, ring_ns: int) -> None:
        """Refuse to read a ring so rarely that a hiccup would cost samples."""
        if self.period_ns > ring_ns // _POLLS:
            most_ms = ring_ns / _POLLS / 1e6
            raise UserError(
                f"source.poll_ms: the ring holds {ring_ns / 1e6:.0f} ms; read it at least every {most_ms:.0f} ms"
            )

    def _note_boot(self, boot: int) -> None:
        """A device that has restarted counts from the start again."""
        if self._boot not in (None, boot):
            self._next = None
            self._numbering.restart()
        self._boot = boot

    def _first_to_fetch(self, newest: int, slots: int) -> int:
        """Where the last fetch ended, or the oldest block that is still safe to read."""
        if self._next is None:
            return newest
        return max(self._next, newest - int(slots * (1 - _SAFE)))
