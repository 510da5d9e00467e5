"""The ring `GVL_Acqd` of the PLC, computed when it is read. `docs/twincat/README.md` describes the fields."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tests.doubles.ads.clock import SlotClock
from tests.doubles.waveform import WaveTable

MAGIC = 0x44514341
HEAD = np.dtype([
    ("nMagic", "<u4"), ("nVersion", "<u2"), ("nHeadSize", "<u2"), ("nSlotSize", "<u4"), ("nSlots", "<u2"),
    ("nChannels", "<u2"), ("nFrames", "<u2"), ("nReserved", "<u2"), ("nSampleNs", "<u4"), ("fScale", "<f4", (6,)),
    ("nBoot", "<u4"), ("nOverruns", "<u4"), ("nNewest", "<u8"),
])  # fmt: skip
"""ST_AcqdHead, 64 bytes."""
CHANNELS = 6
_TOGGLE = 1 << 15


def slot_dtype(frames: int) -> np.dtype[np.void]:
    """ST_AcqdSlot: 40 + 12 * `frames` bytes."""
    return np.dtype([
        ("nSeq", "<u8"), ("nDcTime", "<u8"), ("aStatus", "<u2", (CHANNELS,)), ("nRange", "<u2"),
        ("nSampleCount", "<u2"), ("aSamples", "<i2", (CHANNELS, frames)), ("nSeqEnd", "<u8"),
    ])  # fmt: skip


class Ring:
    """Head and slots at a given time; settings change what later slots hold."""

    def __init__(self, clock: SlotClock, wave: WaveTable, *, frames: int, slots: int, boot: int) -> None:
        self.clock = clock
        self.frames, self.slots = frames, slots
        self.slot_type = slot_dtype(frames)
        self.boot = boot
        self.tear = False
        self._wave = wave
        self._missed: list[range] = []
        self._status: list[tuple[int, tuple[int, ...], int]] = [(1, (0,) * CHANNELS, 0)]  # from seq: status, range

    def newest(self, now: float) -> int:
        """Sequence number of the newest complete slot, 0 if there is none."""
        return self._written(self.clock.latest(now), step=1)

    def overruns(self, now: float) -> int:
        """Slots that the PLC missed, as known when it wrote its newest slot."""
        newest = self.newest(now)
        return sum(len(missed) for missed in self._missed if missed.start <= newest)

    def miss(self, count: int, now: float) -> None:
        """The PLC misses its next `count` slots."""
        first = max(self.clock.latest(now) + 1, self._missed_until())
        self._missed.append(range(first, first + count))

    def unfreeze(self, now: float) -> None:
        """The PLC's program goes on; it missed the cycles of the pause, as it sees from the terminal's time."""
        first = max(self.clock.latest(now) + 1, self._missed_until())
        self.clock.unfreeze()
        if missed := range(first, self.clock.latest(now) + 1):
            self._missed.append(missed)

    def set_status(self, channel: int, value: int, now: float) -> None:
        """Status word of `channel` in the slots from now on; bit 15 still toggles."""
        words = list(self._status[-1][1])
        words[channel] = value & ~_TOGGLE
        self._status.append((self.clock.latest(now) + 1, tuple(words), self._status[-1][2]))

    def set_range(self, bits: int, now: float) -> None:
        """nRange in the slots from now on."""
        self._status.append((self.clock.latest(now) + 1, self._status[-1][1], bits))

    def restart(self, now: float) -> None:
        """The PLC program starts again: new boot number, empty ring, sequence from 1."""
        self.boot = (self.boot + 1) & 0xFFFFFFFF
        self.clock.restart(now)
        self._missed.clear()
        self._status = [(1, *self._status[-1][1:])]

    def head(self, now: float) -> bytes:
        """ST_AcqdHead."""
        head = np.zeros((), HEAD)
        head["nMagic"], head["nVersion"] = MAGIC, 1
        head["nHeadSize"], head["nSlotSize"] = HEAD.itemsize, self.slot_type.itemsize
        head["nSlots"], head["nChannels"], head["nFrames"] = self.slots, 2 * self._wave.phases, self.frames
        head["nSampleNs"] = self.clock.slot_ns // self.frames
        head["fScale"][: len(self._wave.scale)] = self._wave.scale
        head["nBoot"], head["nOverruns"], head["nNewest"] = self.boot, self.overruns(now), self.newest(now)
        return head.tobytes()

    def slot_bytes(self, offset: int, length: int, now: float, *, may_tear: bool) -> bytes:
        """`length` bytes of aSlots from the byte `offset` on."""
        size = self.slot_type.itemsize
        first, stop = offset // size, -(-(offset + length) // size)
        image = self._image(first, stop, now)
        if may_tear and self.tear:
            complete = image[-(-offset // size) - first : (offset + length) // size - first]
            self.tear = not _tear_newest(complete)
        start = offset - first * size
        return image.tobytes()[start : start + length]

    def _image(self, first: int, stop: int, now: float) -> NDArray[np.void]:
        """Slots with the indices `first` to `stop` - 1."""
        latest = self.clock.latest(now)
        at_index = (latest - (latest - index) % self.slots for index in range(first, stop))
        seqs = np.array([self._written(seq, step=self.slots) for seq in at_index], dtype=np.int64)
        image: NDArray[np.void] = np.zeros(len(seqs), self.slot_type)
        runs = np.flatnonzero((np.diff(seqs) != 1) | (seqs[:-1] == 0)) + 1
        for run in np.split(np.arange(len(seqs)), runs):
            if len(run) and seqs[run[0]] > 0:
                self._fill(image[run[0] : run[-1] + 1], int(seqs[run[0]]))
        return image

    def _missed_until(self) -> int:
        """The first sequence number after all missed slots."""
        return self._missed[-1].stop if self._missed else 1

    def _written(self, seq: int, *, step: int) -> int:
        """The last of `seq`, `seq` - `step`, ... that the PLC wrote; 0 if it wrote none of them."""
        while seq > 0 and any(seq in missed for missed in self._missed):
            seq -= step
        return max(seq, 0)

    def _fill(self, image: NDArray[np.void], first: int) -> None:
        """Write consecutive slots from the sequence number `first` on."""
        count = len(image)
        seqs = range(first, first + count)
        image["nSeq"] = image["nSeqEnd"] = seqs
        image["nDcTime"] = [self.clock.dc_time(seq) for seq in seqs]
        image["nSampleCount"] = [self.clock.cycle_of(seq) & 0xFFFF for seq in seqs]
        image["aStatus"], image["nRange"] = zip(*(self._flags(seq) for seq in seqs), strict=True)
        codes = self._wave.codes((first - 1) * self.frames, count * self.frames)
        image["aSamples"][:, : codes.shape[1]] = codes.reshape(count, self.frames, -1).transpose(0, 2, 1)

    def _flags(self, seq: int) -> tuple[tuple[int, ...], int]:
        """Status words and nRange of a slot."""
        words, bits = next((words, bits) for first, words, bits in reversed(self._status) if first <= seq)
        toggle = _TOGGLE if seq % 2 else 0
        return tuple(word | toggle for word in words), bits


def _tear_newest(slots: NDArray[Any]) -> bool:
    """Make the newest of `slots` look half written; False if the PLC wrote none of them yet."""
    if not len(slots) or not slots["nSeq"].max():
        return False
    slots["nSeqEnd"][slots["nSeq"].argmax()] = 0
    return True
