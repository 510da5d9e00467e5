"""Frames of a capture file, with the recorded timing."""

from __future__ import annotations

from pathlib import Path

from tests.doubles.sampled_values.pcap import read_pcap


class Replay:
    """The frames of a pcap file, each once. Its frames are what was captured: the state of a stream does not apply."""

    samples_per_frame = 0

    def __init__(self, path: Path) -> None:
        """Raises OSError, or ValueError as `read_pcap`."""
        self._frames = read_pcap(path)

    def due_s(self, k: int) -> float | None:
        """Time since the first frame [s] of frame `k`; None after the last."""
        return self._frames[k][0] if k < len(self._frames) else None

    def frame(self, k: int) -> bytes:
        """Frame number `k`. Raises IndexError after the last."""
        return self._frames[k][1]
