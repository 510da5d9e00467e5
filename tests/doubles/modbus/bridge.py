"""Waveform bridge: a device of a profile of ours that hands out sampled waveforms through Modbus registers.

The register map is in docs/modbus-bridge/README.md. It is no standard and no product's map.
"""

from __future__ import annotations

import struct
import threading
import time
from typing import Literal

from tests.doubles.modbus.bank import ILLEGAL_ADDRESS, REGISTERS, ModbusFault
from tests.doubles.waveform import WaveTable

MAGIC = 0x41435144
VERSION = 1
HEADER_LENGTH = 33
NEWEST = 26
"""Register of the header with the number of the newest block."""
NONE_YET = 0xFFFFFFFF
SLOT_HEADER = 5
OVERRANGE, UNLOCKED, INVALID = 1, 2, 4
"""Bits of a block's status: a channel clipped; sampling clock not locked; samples are not valid."""
MOST_SLOTS = 512
_HEADER = struct.Struct(">IHHHIHHH6fIIIQH")
_SLOT = struct.Struct(">HHHI")
_EMPTY = _SLOT.pack(0xFFFF, INVALID, 0, 0)

Clock = Literal["real", "lockstep"]


class BlockClock:
    """How many blocks are complete: by CLOCK_MONOTONIC, or `advance` more with each read of the header."""

    def __init__(self, kind: Clock, blocks_per_s: float, advance: int) -> None:
        self.kind = kind
        self.blocks_per_s = blocks_per_s
        self.advance = advance
        self.restart()

    def restart(self) -> None:
        """No block is complete."""
        self._since = time.monotonic()
        self._steps = 0

    def step(self) -> None:
        """The header is being read."""
        if self.kind == "lockstep":
            self._steps += self.advance

    def complete(self) -> int:
        """Blocks complete since the restart."""
        if self.kind == "lockstep":
            return self._steps
        return int((time.monotonic() - self._since) * self.blocks_per_s)


class WaveformBridge:
    """Bank of registers with the newest blocks of `table`: block b has the frames b * frames .. of it.

    `frames` a block (default: as many as make 120 samples), `slots` and `stride` in registers; `drift_ppm` is the
    deviation of the sampling clock from CLOCK_MONOTONIC; without `utc` the header has the time 0.
    """

    def __init__(
        self,
        table: WaveTable,
        *,
        frames: int | None = None,
        slots: int | None = None,
        slot0: int = 64,
        stride: int | None = None,
        clock: Clock = "real",
        advance: int = 20,
        drift_ppm: float = 0.0,
        utc: bool = True,
    ) -> None:
        """Raises ValueError where the slots do not fit between `slot0` and 65536."""
        self.table = table
        self.channels = 2 * table.phases
        self.frames = frames or 120 // self.channels
        self.slot0 = slot0
        self.stride = stride or self.frames * self.channels + SLOT_HEADER
        self.slots = slots or min(MOST_SLOTS, (REGISTERS - slot0) // self.stride)
        self._check()
        self.wrap = NONE_YET // self.slots * self.slots
        """Block numbers start over here."""
        self.utc = utc
        self.boot = 1
        self._frame_s = 1 / (table.rate * (1 + drift_ppm * 1e-6))
        self._clock = BlockClock(clock, 1 / (self.frames * self._frame_s), advance)
        self._lock = threading.Lock()
        self._begin()

    def _check(self) -> None:
        need = self.frames * self.channels + SLOT_HEADER
        if self.stride < need or self.slot0 < HEADER_LENGTH or self.slots < 2:
            raise ValueError(f"{self.slots} slots from {self.slot0} of {self.stride} registers; a block needs {need}")
        if self.slot0 + self.slots * self.stride > REGISTERS:
            raise ValueError(f"{self.slots} slots of {self.stride} registers end above register {REGISTERS - 1}")

    def _begin(self) -> None:
        self._clock.restart()
        self._utc_start_ns = time.time_ns()
        self._skips: list[tuple[int, int]] = []
        self._marks: list[tuple[int, int, int]] = []
        self._frozen: int | None = None
        self._held: list[int] = [-1] * self.slots
        slot = _EMPTY.ljust(2 * self.stride, b"\0")
        self._memory = bytearray(slot * self.slots)

    # ---- faults ----------------------------------------------------------------------------------------------------

    def skip(self, blocks: int) -> None:
        """The bridge could not store the next `blocks` blocks: their numbers are missing, overruns count them."""
        with self._lock:
            first = max([self._clock.complete(), *(end for _, end in self._skips)])
            self._skips.append((first, first + blocks))

    def restart(self) -> None:
        """As after a loss of supply: another boot counter, and block 0 again."""
        with self._lock:
            self.boot = (self.boot + 1) & 0xFFFF
            self._begin()

    def mark(self, status: int, blocks: int) -> None:
        """The next `blocks` blocks have these status bits."""
        with self._lock:
            first = self._clock.complete()
            self._marks.append((first, first + blocks, status))

    @property
    def stale(self) -> bool:
        """True: header and slots are frozen. After that the clock is where it would be without."""
        return self._frozen is not None

    @stale.setter
    def stale(self, on: bool) -> None:
        with self._lock:
            self._frozen = self._newest() if on else None

    # ---- blocks ----------------------------------------------------------------------------------------------------

    def _newest(self) -> int:
        """Number of the newest complete block, -1: none."""
        if self._frozen is not None:
            return self._frozen
        newest = self._clock.complete() - 1
        for first, end in reversed(self._skips):
            newest = first - 1 if first <= newest < end else newest
        return newest

    def _overruns(self, newest: int) -> int:
        """Blocks up to `newest` or now that the bridge could not store."""
        now = newest + 1 if self._frozen is not None else self._clock.complete()
        return sum(max(0, min(end, now) - first) for first, end in self._skips)

    def _stored(self, block: int) -> bool:
        return not any(first <= block < end for first, end in self._skips)

    def _oldest(self, newest: int) -> int:
        """The oldest block that is whole: block newest + 1 is being written into the slot of newest + 1 - slots."""
        oldest = max(0, newest - self.slots + 2)
        while not self._stored(oldest) and oldest < newest:
            oldest += 1
        return oldest

    def _block_in(self, slot: int, newest: int) -> int:
        """Number of the block that the slot holds, -1: none yet."""
        block = newest - (newest - slot) % self.slots
        while block >= 0 and not self._stored(block):
            block -= self.slots
        return max(block, -1)

    def _status(self, block: int) -> int:
        status = 0
        for first, end, bits in self._marks:
            status |= bits if first <= block < end else 0
        return status

    def _fill(self, slot: int, newest: int) -> None:
        """Write the block that the slot should hold, unless it is there."""
        block = self._block_in(slot, newest)
        if block < 0 or self._held[slot] == block:
            return
        first = block * self.frames
        codes = self.table.codes(first, self.frames).astype(">i2").tobytes()
        at = 2 * slot * self.stride
        head = _SLOT.pack(block % self.wrap & 0xFFFF, self._status(block), first >> 32, first & 0xFFFFFFFF)
        self._memory[at : at + len(head) + len(codes)] = head + codes
        self._held[slot] = block

    # ---- registers -------------------------------------------------------------------------------------------------

    def _utc_ns(self, newest: int) -> int:
        if not self.utc or newest < 0:
            return 0
        return self._utc_start_ns + round(newest * self.frames * self._frame_s * 1e9)

    def _header(self, newest: int) -> bytes:
        lsb = self.table.scale + (0.0,) * (6 - self.channels)
        return _HEADER.pack(
            MAGIC,
            VERSION,
            self.channels,
            self.frames,
            round(self.table.rate * 1000),
            self.slots,
            self.stride,
            self.slot0,
            *lsb,
            self._overruns(newest),
            0 if newest < 0 else self._oldest(newest) % self.wrap,
            NONE_YET if newest < 0 else newest % self.wrap,
            self._utc_ns(newest),
            self.boot,
        )

    def _read_header(self, address: int, count: int) -> bytes:
        if address <= NEWEST < address + count and self._frozen is None:
            self._clock.step()
        return self._header(self._newest())[2 * address : 2 * (address + count)]

    def _read_slots(self, offset: int, count: int) -> bytes:
        newest = self._newest()
        for slot in range(offset // self.stride, (offset + count - 1) // self.stride + 1):
            self._fill(slot, newest)
        return bytes(self._memory[2 * offset : 2 * (offset + count)])

    def read_bytes(self, function: int, address: int, count: int) -> bytes:
        """Registers of one instant. Raises ModbusFault(2) outside of header and slots."""
        with self._lock:
            if address + count <= HEADER_LENGTH:
                return self._read_header(address, count)
            offset = address - self.slot0
            if offset < 0 or offset + count > self.slots * self.stride:
                raise ModbusFault(ILLEGAL_ADDRESS)
            return self._read_slots(offset, count)

    def read(self, function: int, address: int, count: int) -> list[int]:
        """The same as values 0..65535."""
        return list(struct.unpack(f">{count}H", self.read_bytes(function, address, count)))
