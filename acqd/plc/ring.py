"""The shared-memory ring between MAIN_FAST (one writer) and MAIN_SLOW (one reader).

An anonymous memory file that both processes map: nothing to name, nothing left behind. The writer
stores samples, then advances the head; the reader copies, then checks that the head has not lapped
it. Gaps, clock steps and flags travel next to the samples, in a small ring of events. Aligned 8-byte stores
are atomic on the supported machines, and each window is announced through an eventfd, whose system
calls order memory between the two sides.
"""

from __future__ import annotations

import json
import mmap
import os
import time
from dataclasses import asdict, dataclass

import numpy as np

from acqd.metering.block import CodeBits, Codes, SampleBlock, code_type
from acqd.plc.stats import SLOTS
from acqd.sources.base import SourceHealth

_HEADER = 16  # int64 words
_HEAD, _EVENT_HEAD, _STATE, _ANCHOR_INDEX, _ANCHOR_UTC, _HEALTH_VERSION, _HEALTH_BYTES, _BEATS, _TAKEN = range(9)
_EVENTS = 32_768  # two per cycle for as long as the ring lasts
_EVENT_WORDS = 3  # position, kind, value
RUNNING, ENDED, STOPPED = 1, 2, 3
"""States of the writer: running; the source has ended; stopped on request."""
GAP, STEP, LATE, FLAGS = 1, 2, 3, 4
"""Kinds of event: samples lost; clock step; samples caught up late; the source's own flags change."""
_KIND_FLAGS = {STEP: "clock_step", LATE: "late"}
SOURCE_FLAGS = ("simulated", "overrange", "sync_error", "invalid", "clock_unlocked", "test", "derived",
                "clipped", "rollover", "offset")  # fmt: skip
"""Row flags that a source may set and clear while it runs; their bits are the value of a FLAGS event."""
_HEALTH_ROOM = 128  # int64 words for the health of the source, as JSON


@dataclass(frozen=True, slots=True)
class RingLayout:
    """Sizes both sides agree on."""

    rate: float
    channels: int
    capacity: int
    """Samples the ring holds (all channels)."""
    bits: CodeBits = 16
    """Width of a code."""

    @property
    def codes_offset(self) -> int:
        """Bytes before the first code."""
        return 8 * (_HEADER + _HEALTH_ROOM + _EVENTS * _EVENT_WORDS + SLOTS)

    @property
    def bytes(self) -> int:
        """Size of the memory file."""
        return self.codes_offset + self.capacity * self.channels * self.bits // 8


class Ring:
    """Both ends of the ring over one memory file descriptor."""

    def __init__(self, layout: RingLayout, fd: int) -> None:
        self.layout = layout
        self._map = mmap.mmap(fd, layout.bytes)
        words = memoryview(self._map)[: layout.codes_offset].cast("q")
        self._header, words = words[:_HEADER], words[_HEADER:]
        self._health, words = words[:_HEALTH_ROOM].cast("B"), words[_HEALTH_ROOM:]
        self._events, self.cycle_slots = words[: _EVENTS * _EVENT_WORDS], words[_EVENTS * _EVENT_WORDS :]
        dtype = code_type(layout.bits)
        self._codes: Codes = np.frombuffer(self._map, dtype, offset=layout.codes_offset).reshape(-1, layout.channels)
        self._position = 0  # reader: samples taken
        self._event_tail = 0
        self._index = 0  # reader: stream index of the next sample
        self._anchor = (0, 0)  # reader: a stream index and its UTC
        self._flags: frozenset[str] = frozenset()  # reader: the source's flags from here on
        self._health_version = 0  # reader: of the health that was read last
        self._last_health: SourceHealth | None = None
        self._unbroken = 0  # reader: position from which on nothing is missing and time has not stepped

    @staticmethod
    def create(layout: RingLayout) -> tuple[Ring, int]:
        """A fresh ring and the descriptor to hand to the other process."""
        fd = os.memfd_create("acqd-ring", 0)
        os.ftruncate(fd, layout.bytes)
        return Ring(layout, fd), fd

    # -- writer --

    def begin(self, index: int, utc_ns: int) -> None:
        """The stream starts with sample `index` at `utc_ns`."""
        self._header[_ANCHOR_INDEX], self._header[_ANCHOR_UTC] = index, utc_ns
        self._header[_STATE] = RUNNING

    def write(self, codes: Codes) -> None:
        """Append samples."""
        head, capacity = self._header[_HEAD], self.layout.capacity
        at, count = head % capacity, len(codes)
        first = min(count, capacity - at)
        self._codes[at : at + first] = codes[:first]
        if first < count:
            self._codes[: count - first] = codes[first:]
        self._header[_HEAD] = head + count
        self._header[_TAKEN] = time.monotonic_ns()

    def beat(self) -> None:
        """Say that the writer cycles."""
        self._header[_BEATS] += 1

    def event(self, kind: int, value: int = 0) -> None:
        """Something that happens at the next sample: GAP (samples lost), STEP (new UTC), LATE, FLAGS (bits)."""
        number = self._header[_EVENT_HEAD]
        slot = number % _EVENTS * _EVENT_WORDS
        for word, content in enumerate((self._header[_HEAD], kind, value)):
            self._events[slot + word] = content
        self._header[_EVENT_HEAD] = number + 1

    def report(self, health: SourceHealth) -> None:
        """Tell the reader how the source is."""
        reason, text = health.reason, b""
        while not text or len(text) > len(self._health):
            text = json.dumps(asdict(health) | {"reason": reason}, ensure_ascii=False).encode()
            reason = reason[:-20]
        self._header[_HEALTH_VERSION] += 1  # odd: being written
        self._health[: len(text)] = text
        self._header[_HEALTH_BYTES] = len(text)
        self._header[_HEALTH_VERSION] += 1

    def finish(self, state: int) -> None:
        """No more samples will come."""
        self._header[_STATE] = state

    # -- both --

    @property
    def codes(self) -> Codes:
        """All of the ring's samples."""
        return self._codes

    def addresses(self) -> dict[str, int]:
        """Where the writer's words and the samples are, for C (`ticks.c`)."""
        ring = self._codes.ctypes.data
        base = ring - self.layout.codes_offset
        words = {"head": _HEAD, "taken": _TAKEN, "beats": _BEATS}
        counters = base + 8 * (_HEADER + _HEALTH_ROOM + _EVENTS * _EVENT_WORDS)
        return {name: base + 8 * word for name, word in words.items()} | {"counters": counters, "ring": ring}

    @property
    def state(self) -> int:
        """0 before `begin`, then RUNNING, ENDED or STOPPED."""
        return int(self._header[_STATE])

    @property
    def beats(self) -> int:
        """Cycles of the writer; a number that stands still is a writer that hangs."""
        return int(self._header[_BEATS])

    @property
    def written(self) -> int:
        """Samples written since the start, without lost ones."""
        return int(self._header[_HEAD])

    # -- reader --

    def health(self) -> SourceHealth | None:
        """How the source is; None while nothing has been said, or while it is being written."""
        version = self._header[_HEALTH_VERSION]
        if version == self._health_version:
            return self._last_health
        text = bytes(self._health[: self._header[_HEALTH_BYTES]])
        if not version or version % 2 or version != self._header[_HEALTH_VERSION]:
            return None
        self._health_version, self._last_health = version, SourceHealth(**json.loads(text))
        return self._last_health

    def reached(self) -> tuple[int, int, int] | None:
        """Index and UTC [ns] of the sample that `read` would give next, and when that was due on CLOCK_MONOTONIC [ns].

        None before the first read. The last is when the writer wrote: one that has hung for a while wrote long ago.
        """
        if not self._position:
            return None
        anchor, utc = self._anchor
        return self._index, utc + round((self._index - anchor) * 1e9 / self.layout.rate), int(self._header[_TAKEN])

    def read(self) -> list[SampleBlock]:
        """Everything new, cut into blocks where an event happened."""
        if not self.state:
            return []
        head = self._header[_HEAD]
        if not self._position and not self._event_tail:
            self._index = self._header[_ANCHOR_INDEX]
            self._anchor = (self._index, self._header[_ANCHOR_UTC])
        blocks: list[SampleBlock] = []
        momentary: frozenset[str] = frozenset()
        lost = self._skip_overwritten()
        for position, kind, value in [*self._new_events(head), (head, 0, 0)]:
            if position > self._position:
                block = self._take(position, lost, self._flags | momentary)
                lost, momentary = 0, frozenset()
                if len(block.codes):
                    blocks.append(block)
            if kind == GAP:
                lost += value
                self._index += value
            elif kind == FLAGS:
                self._flags = frozenset(name for bit, name in enumerate(SOURCE_FLAGS) if value >> bit & 1)
            elif kind in _KIND_FLAGS:
                momentary |= {_KIND_FLAGS[kind]}
            if kind == STEP:
                behind = self._position - position  # more than 0 when the step itself was lapped
                self._anchor = (self._index - behind, value)
                self._unbroken = self._position
        return blocks

    def recent(self, samples: int) -> SampleBlock | None:
        """The newest samples that were read, once more: at most `samples`, without a gap or clock step among them.

        None when there are none. In the reader's thread only.
        """
        capacity = self.layout.capacity
        begin = max(self._position - samples, self._unbroken, 0)
        codes = self._codes[np.arange(begin, self._position) % capacity]
        # As in `_take`: what the writer has reached, or may be writing now, is not ours any more.
        codes = codes[max(0, int(self._header[_HEAD]) - capacity * 3 // 4 - begin) :]
        if not len(codes):
            return None
        anchor, utc = self._anchor
        index = self._index - len(codes)
        return SampleBlock(codes, index, utc + round((index - anchor) * 1e9 / self.layout.rate), 0, self._flags)

    def _take(self, until: int, lost: int, flags: frozenset[str]) -> SampleBlock:
        capacity = self.layout.capacity
        start, stop = self._position % capacity, until % capacity
        if start < stop:
            codes = self._codes[start:stop].copy()
        else:
            codes = np.concatenate((self._codes[start:], self._codes[:stop]))
        anchor, utc = self._anchor
        # The writer may have come round while we copied: what it reached is not ours any more.
        torn = min(self._overwritten(), len(codes))
        if lost or torn:
            self._unbroken = self._position + torn
        if torn:
            codes, lost = codes[torn:], lost + torn
            self._index += torn
        block = SampleBlock(
            codes, self._index, utc + round((self._index - anchor) * 1e9 / self.layout.rate), lost, flags
        )
        self._index += len(codes)
        self._position = until
        return block

    def _overwritten(self) -> int:
        """Samples from our position on that the writer has reached, or may be writing now."""
        room = self.layout.capacity * 3 // 4
        return max(0, int(self._header[_HEAD]) - room - self._position)

    def _skip_overwritten(self) -> int:
        """Samples lost because the reader came too late."""
        lost = self._overwritten()
        self._position += lost
        self._index += lost
        return lost

    def _new_events(self, head: int) -> list[tuple[int, int, int]]:
        """Events up to `head`, oldest first; those whose samples are gone keep their effect."""
        end = self._header[_EVENT_HEAD]
        self._event_tail = max(self._event_tail, end - _EVENTS)
        events = []
        while self._event_tail < end:
            slot = self._event_tail % _EVENTS * _EVENT_WORDS
            position, kind, value = self._events[slot : slot + _EVENT_WORDS]
            if position >= head:  # an event belongs to the next sample: it waits for that
                break
            events.append((position, kind, value))
            self._event_tail += 1
        return events

    def close(self) -> None:
        """Unmap; views given out before stay valid (blocks are copies)."""
        self._header.release()
        self._health.release()
        self._events.release()
        self.cycle_slots.release()
        del self._codes
        self._map = None  # type: ignore[assignment]
