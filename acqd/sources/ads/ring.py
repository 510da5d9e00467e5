"""The ring in the PLC's memory: head and slots, byte for byte as docs/twincat declares them."""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

MAGIC = int.from_bytes(b"ACQD", "little")
VERSION = 1
_HEAD = struct.Struct("<IHHIHHHHI6fIIQ")
HEAD_BYTES = _HEAD.size
_CHANNELS = 6  # a slot always has room for six


class RingError(ValueError):
    """The PLC's memory holds no ring of ours; one line."""


@dataclass(frozen=True, slots=True)
class Head:
    """ST_AcqdHead."""

    slot_bytes: int
    slots: int
    channels: int
    """2, 4 or 6."""
    frames: int
    """Samples per channel and slot."""
    sample_ns: int
    """Sampling period [ns]."""
    scale: tuple[float, ...]
    """V or A per digit of the channels in use."""
    boot: int
    """Another value after each start of the PLC."""
    overruns: int
    """Slots that the PLC itself could not fill."""
    newest: int
    """Sequence number of the newest whole slot; 0: none yet."""

    @property
    def slot_type(self) -> np.dtype[np.void]:
        """ST_AcqdSlot."""
        return np.dtype(
            [
                ("seq", "<u8"),
                ("dc_time", "<u8"),
                ("status", "<u2", (_CHANNELS,)),
                ("range", "<u2"),
                ("sample_count", "<u2"),
                ("samples", "<i2", (_CHANNELS, self.frames)),
                ("seq_end", "<u8"),
            ]
        )

    @property
    def same_ring(self) -> tuple[int, ...]:
        """What cannot change while the stream lasts."""
        return self.slot_bytes, self.slots, self.channels, self.frames, self.sample_ns


def parse_head(data: bytes) -> Head:
    """The head. Raises RingError that says what was expected."""
    if len(data) != HEAD_BYTES:
        raise RingError(f"the head has {len(data)} bytes, expected {HEAD_BYTES}")
    magic, version, size, slot_bytes, slots, channels, frames, _, sample_ns, *rest = _HEAD.unpack(data)
    *scale, boot, overruns, newest = rest
    if magic != MAGIC:
        raise RingError(f"the head starts with {magic:#010x}, expected {MAGIC:#010x}; has the PLC program started?")
    if version != VERSION or size != HEAD_BYTES:
        raise RingError(f"the ring has version {version} with a head of {size} bytes, expected {VERSION}, {HEAD_BYTES}")
    if channels not in (2, 4, 6) or not 1 <= frames <= 1000 or not 2 <= slots <= 65_535 or not sample_ns:
        raise RingError(f"the head announces {channels} channels, {frames} frames, {slots} slots, {sample_ns} ns")
    head = Head(slot_bytes, slots, channels, frames, sample_ns, tuple(scale[:channels]), boot, overruns, newest)
    if slot_bytes != head.slot_type.itemsize:
        raise RingError(
            f"a slot has {slot_bytes} bytes, expected {head.slot_type.itemsize}; declare it with pack_mode 1"
        )
    if not all(math.isfinite(value) and value > 0 for value in head.scale):
        raise RingError(f"fScale is {head.scale}; expected V or A per digit of each channel, above 0")
    return head


@dataclass(frozen=True, slots=True)
class Slots:
    """Whole slots, in order; sequence numbers may be missing between them."""

    seq: NDArray[np.int64]
    codes: NDArray[np.int16]
    """[slots, frames, channels]."""
    status: NDArray[np.uint16]
    """[slots, channels] status words of the terminal."""
    fine_range: NDArray[np.uint16]
    """[slots] bit k: current channel k was in the 1 A range."""


def read_slots(head: Head, data: bytes, first: int) -> Slots:
    """The whole ones among the slots of sequence numbers `first`, `first` + 1, ...

    A slot that is being written, that has been written over, or that the PLC never filled is left out.
    """
    table = np.frombuffer(data, head.slot_type)
    seq = first + np.arange(len(table), dtype=np.int64)
    whole = (table["seq"] == seq.astype(np.uint64)) & (table["seq_end"] == seq.astype(np.uint64))
    table = table[whole]
    codes = table["samples"][:, : head.channels].transpose(0, 2, 1)
    return Slots(seq[whole], np.ascontiguousarray(codes), table["status"][:, : head.channels], table["range"])
