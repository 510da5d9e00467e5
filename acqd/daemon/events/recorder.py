"""Keeps the newest samples, and cuts waveforms out of them: from before an event until it is over."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from acqd.metering.block import SampleBlock, StreamFormat
from acqd.metering.quality.event import Event
from acqd.sources.waveform import Waveform
from acqd.timestamps import rfc3339

_DETECTION_S = 1.5
"""An event is known later than it starts: a rapid voltage change, after a second of steady voltage."""

Save = Callable[[str, Waveform], bool]
"""Takes a waveform and its name; False when there is no room for another one."""


@dataclass(slots=True)
class _Pending:
    """A waveform that is not complete."""

    name: str
    first: int
    end: int
    """Sample after the last one, as planned."""


class Recorder:
    """One waveform at a time: what happens during a recorded event is in its waveform."""

    def __init__(self, form: StreamFormat, pre_s: float, post_s: float, save: Save) -> None:
        self._form, self._save = form, save
        self._pre, self._post = round(pre_s * form.rate), round(post_s * form.rate)
        self._reach = self._pre + round(_DETECTION_S * form.rate)
        self._blocks: deque[SampleBlock] = deque()
        self._pending: _Pending | None = None
        self._ends_with: int | None = None  # number of the event whose end ends the waveform

    def add(self, block: SampleBlock) -> None:
        """The next samples; a gap ends a waveform."""
        if self._blocks and block.index != self._next:
            self.finish()
            self._blocks.clear()
        self._blocks.append(block)
        keep = self._next - self._reach if self._pending is None else self._pending.first
        while len(self._blocks[0].codes) + self._blocks[0].index <= keep:
            self._blocks.popleft()
        if self._pending is not None and self._next >= self._pending.end:
            self.finish()

    def begin(self, event: Event) -> str | None:
        """Name of the waveform that will hold the start of `event`; None if its samples are gone."""
        begin = int(event.begin)
        if not self._blocks or begin < self._blocks[0].index:
            return None
        if self._pending is None:
            name = f"{_stamp(event.utc_ns)}-{event.kind}.npz"
            self._pending = _Pending(name, begin - self._pre, begin + max(self._post, 1))
            self._ends_with = event.number
        return self._pending.name

    def end(self, event: Event) -> None:
        """Record as long after the end of the event as before its start, at most."""
        if self._pending is not None and event.number == self._ends_with and event.end is not None:
            self._pending.end = min(self._pending.end, int(event.end) + self._pre)

    def finish(self) -> None:
        """Hand over what there is of the pending waveform."""
        pending, self._pending = self._pending, None
        if pending is None or not self._blocks:
            return
        origin = self._blocks[0].index
        codes = np.concatenate([block.codes for block in self._blocks])
        first = max(pending.first, origin)
        part = codes[first - origin : pending.end - origin]
        begun = self._blocks[0].utc_ns + round((first - origin) * 1e9 / self._form.rate)
        simulated = any("simulated" in block.flags for block in self._blocks)
        if len(part):
            self._save(pending.name, Waveform(pending.name, part.copy(), self._form, begun, simulated))

    @property
    def _next(self) -> int:
        return self._blocks[-1].index + len(self._blocks[-1].codes)


def _stamp(utc_ns: int) -> str:
    """20261231T235959.123456Z: sorts by time, and is a file name everywhere."""
    return rfc3339(utc_ns).replace("-", "").replace(":", "")
