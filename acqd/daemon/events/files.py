"""Waveforms of events as NPZ files in the state folder: bounded in number and size, written by a thread."""

from __future__ import annotations

import logging
import queue
import threading
from pathlib import Path

from acqd.atomic import write_complete
from acqd.changes import StateLog
from acqd.errors import OperationError
from acqd.sources.npz_write import npz_bytes
from acqd.sources.waveform import Waveform

_log = logging.getLogger(__name__)
_AHEAD = 8
"""Waveforms that may wait for the disk."""


class WaveformFiles:
    """The folder `events-DEVICE`; the oldest files go first. A disk that fails is logged once."""

    def __init__(self, folder: Path, most: int, most_bytes: float) -> None:
        self._folder, self._most, self._most_bytes = folder, most, most_bytes
        self._todo: queue.Queue[tuple[str, Waveform] | None] = queue.Queue(_AHEAD)
        self._says = StateLog(_log)
        self._thread: threading.Thread | None = None

    def save(self, name: str, waveform: Waveform) -> bool:
        """Have a waveform written; False when too many wait."""
        if self._thread is None:  # a quiet mains needs no thread
            self._thread = threading.Thread(target=self._run, name="events", daemon=True)
            self._thread.start()
        try:
            self._todo.put_nowait((name, waveform))
        except queue.Full:
            self._says.trouble("events", "behind", f"{self._folder}: the disk is slow, {name} is not kept")
            return False
        return True

    def close(self, timeout: float = 1.0) -> None:
        """Write what waits, for `timeout` [s] at most."""
        if self._thread is not None:
            try:
                self._todo.put(None, timeout=timeout)
            except queue.Full:
                return
            self._thread.join(timeout)
            self._thread = None

    def _run(self) -> None:
        while (order := self._todo.get()) is not None:
            name, waveform = order
            try:
                content = npz_bytes(waveform)
                self._make_room(len(content))
                write_complete(self._folder / name, content)
            except (OperationError, OSError) as error:
                self._says.trouble("events", "disk", f"{error}; waveforms are not kept")
            else:
                self._says.fine("events", "waveforms are kept again")

    def _make_room(self, size: int) -> None:
        """Delete the oldest files until there is room for another one of `size` bytes."""
        self._folder.mkdir(mode=0o750, parents=True, exist_ok=True)
        files = sorted(self._folder.glob("*.npz"))
        sizes = [path.stat().st_size for path in files]
        while files and (len(files) >= self._most or sum(sizes) + size > self._most_bytes):
            files.pop(0).unlink(missing_ok=True)
            sizes.pop(0)
