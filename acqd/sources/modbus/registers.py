"""The waveform bridge's register map (acqd's profile, docs/modbus-bridge): header and slots."""

from __future__ import annotations

import math
import struct
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

MAGIC = 0x41435144
"""ACQD."""
VERSION = 1
HEADER_REGISTERS = 33
MOVING, MOVING_REGISTERS = 22, 11
"""First and number of the header's registers that change while the bridge runs."""
NO_BLOCK = 0xFFFF_FFFF
_SLOT_HEADER = 5
_FIXED = struct.Struct(">IHHHIHHH6f")
_MOVING = struct.Struct(">IIIQH")
_FLAG_BITS = {1 << 0: "overrange", 1 << 1: "clock_unlocked", 1 << 2: "invalid"}


class MapError(ValueError):
    """The registers hold no bridge of ours; one line."""


@dataclass(frozen=True, slots=True)
class Layout:
    """What does not change while the bridge runs."""

    channels: int
    frames: int
    """Samples per channel and block."""
    rate: float
    """Samples/s."""
    slots: int
    stride: int
    """Registers from slot to slot."""
    slot0: int
    """Register of slot 0."""
    scale: tuple[float, ...]
    """V or A per digit."""

    @property
    def block_registers(self) -> int:
        """Registers of one slot that mean something."""
        return _SLOT_HEADER + self.frames * self.channels

    @property
    def block_ns(self) -> int:
        """Duration of a block [ns]."""
        return round(self.frames * 1e9 / self.rate)

    @property
    def wrap(self) -> int:
        """Block numbers run from 0 to this - 1 and start over: a multiple of the slots, below NO_BLOCK."""
        return NO_BLOCK // self.slots * self.slots

    def address(self, block: int) -> int:
        """First register of a block's slot."""
        return self.slot0 + block % self.slots * self.stride


@dataclass(frozen=True, slots=True)
class Progress:
    """What changes while the bridge runs."""

    overruns: int
    """Blocks that the bridge itself could not store."""
    oldest: int
    newest: int
    """Newest whole block; -1: none yet."""
    utc_ns: int
    """UTC of the newest block's first sample; 0: the bridge does not know."""
    boot: int


def parse_layout(data: bytes) -> Layout:
    """The fixed part of the header. Raises MapError that says what was expected."""
    magic, version, channels, frames, millihertz, slots, stride, slot0, *scale = _FIXED.unpack_from(data)
    if magic != MAGIC:
        swapped = (magic >> 16 | magic << 16) & 0xFFFF_FFFF
        hint = "; its words are in the wrong order" if swapped == MAGIC else ""
        raise MapError(f"the header starts with {magic:#010x}, expected {MAGIC:#010x} (ACQD){hint}")
    if version != VERSION:
        raise MapError(f"the register map has version {version}, expected {VERSION}")
    layout = Layout(channels, frames, millihertz / 1000, slots, stride, slot0, tuple(scale[:channels]))
    if channels not in (2, 4, 6) or not frames or slots < 2 or not millihertz:
        raise MapError(f"the header announces {channels} channels, {frames} frames, {slots} slots, {layout.rate} Hz")
    if stride < layout.block_registers or layout.block_registers > 125:
        raise MapError(
            f"a block takes {layout.block_registers} registers at a stride of {stride}; at most 125 fit one read"
        )
    if slot0 + slots * stride > 0x1_0000:
        raise MapError(f"{slots} slots of {stride} registers from {slot0} on do not fit 65536 registers")
    if not all(math.isfinite(value) and value > 0 for value in layout.scale):
        raise MapError(f"the scales are {layout.scale}; expected V or A per digit of each channel, above 0")
    return layout


def parse_progress(data: bytes) -> Progress:
    """The moving part of the header."""
    overruns, oldest, newest, utc_ns, boot = _MOVING.unpack(data)
    return Progress(overruns, oldest, -1 if newest == NO_BLOCK else newest, utc_ns, boot)


@dataclass(frozen=True, slots=True)
class Blocks:
    """Slots, decoded; one line per block."""

    valid: NDArray[np.bool_]
    """Whether the slot held the block that was asked for."""
    counter: NDArray[np.int64]
    """Number of the first frame since the bridge started."""
    status: NDArray[np.int64]
    codes: NDArray[np.int16]
    """[blocks, frames, channels]."""


def decode_blocks(layout: Layout, first: int, data: bytes) -> Blocks:
    """Blocks `first`, `first` + 1, ... from the registers of their slots, `block_registers` each."""
    table = np.frombuffer(data, ">u2").reshape(-1, layout.block_registers)
    wide = table[:, :_SLOT_HEADER].astype(np.int64)
    expected = (first + np.arange(len(table))) % layout.wrap & 0xFFFF
    samples = table[:, _SLOT_HEADER:].astype(np.uint16).view(np.int16)
    return Blocks(
        wide[:, 0] == expected,
        wide[:, 2] << 32 | wide[:, 3] << 16 | wide[:, 4],
        wide[:, 1],
        samples.reshape(-1, layout.frames, layout.channels),
    )


def status_flags(status: int) -> frozenset[str]:
    """Row flags of a block's status register."""
    return frozenset(name for bit, name in _FLAG_BITS.items() if status & bit)
