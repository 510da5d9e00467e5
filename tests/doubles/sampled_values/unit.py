"""The merging unit: streams, their faults, a packet socket and a clock."""

from __future__ import annotations

import contextlib
import socket
import time
from collections.abc import Sequence
from typing import Protocol

from tests.doubles.sampled_values.faults import Faults

CATCH_UP = 256
"""Frames sent in one turn after a stall, so that commands are still answered."""


class FrameSource(Protocol):
    """Frames by number, with the time at which each leaves."""

    @property
    def samples_per_frame(self) -> int:
        """Samples in one frame, 0 if unknown."""
        ...

    def due_s(self, k: int) -> float | None:
        """Time since the start [s] of frame `k`; None where there is no such frame."""
        ...

    def frame(self, k: int) -> bytes:
        """The octets of frame `k`."""
        ...


class Lane:
    """One source on the wire: the number of its next frame, its faults and counters."""

    def __init__(self, source: FrameSource) -> None:
        self.source = source
        self.faults = Faults()
        self.next = 0
        self.sent = 0
        self.send_errors = 0

    @property
    def due_s(self) -> float | None:
        """Time since the start [s] of the next frame; None after the last."""
        return self.source.due_s(self.next)

    def send(self, port: socket.socket) -> None:
        """Sends the next frame, or what the faults make of it. A link that is down counts as a send error."""
        due_s = self.due_s
        if due_s is None:
            return
        frames = self.faults.frames(self.source.frame(self.next), due_s)
        self.next += 1
        for frame in frames:
            try:
                port.send(frame)
                self.sent += 1
            except OSError:
                self.send_errors += 1

    def stats(self) -> dict[str, int]:
        """Counters: `built` frames by number, `sent` frames on the wire (with repeated and damaged ones)."""
        size = self.source.samples_per_frame
        lost = self.faults.counts["dropped"] + self.faults.counts["malformed"]
        return {
            "built": self.next,
            "sent": self.sent,
            "send_errors": self.send_errors,
            "next_sample": self.next * size,
            "samples_intact": (self.next - lost) * size,
            **self.faults.counts,
        }


class MergingUnit:
    """Publishes one or more sources on an interface.

    The real clock sends each frame at its time on CLOCK_MONOTONIC and catches up after a stall;
    the burst clock sends only on `burst`. Raises OSError where the interface is absent or the
    process may not open a packet socket.
    """

    def __init__(self, interface: str, sources: Sequence[FrameSource], clock: str = "real") -> None:
        """`clock` is "real" or "burst"."""
        self.lanes = [Lane(source) for source in sources]
        self.clock = clock
        self.late_max_s = 0.0
        self._origin_s: float | None = None
        self._stalled_until_s = float("-inf")
        # Protocol 0: the socket sends only and receives no frames.
        self._port = socket.socket(socket.AF_PACKET, socket.SOCK_RAW, 0)
        self._port.bind((interface, 0))

    @property
    def running(self) -> bool:
        """True after `start`, until `stop`."""
        return self._origin_s is not None

    def start(self) -> None:
        """Lets the streams go on from their next frames, the first of which leaves now. Raises ValueError in bursts."""
        if self.clock != "real":
            raise ValueError("The burst clock sends frames on the command burst only")
        due_s = [lane.due_s for lane in self.lanes if lane.due_s is not None]
        self._origin_s = time.monotonic() - min(due_s, default=0.0)

    def stop(self) -> None:
        """Sends nothing until the next `start`; no frame is lost."""
        self._origin_s = None

    def stall(self, seconds: float) -> None:
        """Sends nothing for a time; then the frames of that time leave at once."""
        self._stalled_until_s = time.monotonic() + seconds

    def wait_s(self) -> float | None:
        """Time until `send_due` has something to do [s]; None if never."""
        lane = self._first()
        if self._origin_s is None or lane is None or lane.due_s is None:
            return None
        now_s = time.monotonic()
        return max(0.0, self._origin_s + lane.due_s - now_s, self._stalled_until_s - now_s)

    def send_due(self) -> None:
        """Sends the frames whose time has come, in the order of their times, at most `CATCH_UP`."""
        for _ in range(CATCH_UP):
            if self._origin_s is None or self.wait_s() != 0.0:
                return
            lane = self._first()
            if lane is not None and lane.due_s is not None:
                self.late_max_s = max(self.late_max_s, time.monotonic() - self._origin_s - lane.due_s)
                lane.send(self._port)

    def burst(self, count: int) -> int:
        """Builds and sends the next `count` frames of each source in turn; returns the number of frames sent."""
        if self.running:
            raise ValueError("Frames leave by the clock; a burst needs the burst clock or the command stop")
        before = sum(lane.sent for lane in self.lanes)
        for _ in range(count):
            for lane in self.lanes:
                lane.send(self._port)
        return sum(lane.sent for lane in self.lanes) - before

    def close(self) -> None:
        """Closes the socket."""
        with contextlib.suppress(OSError):
            self._port.close()

    def _first(self) -> Lane | None:
        """The lane whose next frame leaves first."""
        waiting = [(due_s, n) for n, lane in enumerate(self.lanes) if (due_s := lane.due_s) is not None]
        return self.lanes[min(waiting)[1]] if waiting else None
