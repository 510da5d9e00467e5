"""Slave controller: registers and memory that datagrams read and write, and its FMMUs (ET1100 data sheet, II)."""

from __future__ import annotations

from typing import NamedTuple

from . import sii
from .clock import Clock
from .dc import DistributedClock
from .mailbox import Mailbox
from .registers import (
    AL_CONTROL,
    DC_ACTIVATION,
    DC_RECEIVE,
    DC_SYSTEM,
    DL_STATUS,
    FMMU,
    FMMU_COUNT,
    MEMORY_SIZE,
    READ_ONLY,
    SII_CONTROL,
    SM,
    SM_COUNT,
    STATION,
    U16,
    U32,
)
from .states import INIT, SAFEOP, StateMachine

INPUTS = SM + 8 * 3
"""SyncManager 3: the inputs."""


class Fmmu(NamedTuple):
    """One active logical mapping: logical bytes [start, end) from bit `first_bit` on to physical memory."""

    start: int
    end: int
    first_bit: int
    bits: int
    physical: int
    physical_bit: int
    reads: bool
    writes: bool
    inputs: bool

    @property
    def plain(self) -> bool:
        """Whether it maps whole bytes."""
        return self.first_bit == 0 and self.physical_bit == 0 and self.bits == 8 * (self.end - self.start)


class SlaveController:
    """One slave: its memory, clock, states and mailbox; subclasses say what device stands behind it.

    `ports` are the physical layers of the four ports, two bits each (3: MII, 2: E-bus, 0: not there).
    """

    def __init__(self, eeprom: bytes, clock: Clock, position: int, ports: int) -> None:
        self.memory = bytearray(MEMORY_SIZE)
        self._eeprom = eeprom
        self._ports = ports
        self.fmmus: list[Fmmu] = []
        # Each slave has been on for another time: only a master that configures the clocks sees equal times.
        self.clock = DistributedClock(self.memory, clock, 1_000_000_000 * (position + 1))
        self.states = StateMachine(self.memory, self.check)
        self.mailbox = Mailbox(self.memory, self.answer)
        self._describe()

    def check(self, wanted: int) -> int:
        """AL status code that refuses the next state `wanted`, or 0."""
        return 0

    def answer(self, mail: bytes) -> bytes | None:
        """Answer to a mailbox message."""
        return None

    @property
    def station(self) -> int:
        """Configured station address."""
        return self.memory[STATION] | self.memory[STATION + 1] << 8

    @property
    def inputs_open(self) -> bool:
        """Whether the inputs' memory may be read: from SAFE-OP on, with its SyncManager active."""
        return self.states.state >= SAFEOP and bool(self.memory[INPUTS + 6] & 0x01)

    def set_links(self, hops: int, followers: int) -> None:
        """Say how many slaves are before and behind this one: DL status shows port 0, and port 1 where one follows."""
        self.clock.hops, self.clock.followers = hops, followers
        link = 0x0011 | (0x0020 if followers else 0)
        loops = 0x5000 | 0x0200 | (0x0800 if followers else 0x0400)
        U16.pack_into(self.memory, DL_STATUS, link | loops)

    def power_cycle(self) -> None:
        """Registers, memory, state and local clock as after power-on."""
        self.memory[:] = bytes(MEMORY_SIZE)
        self.fmmus = []
        self.mailbox.reset()
        self.clock.reset()
        self.states.reset()
        self._describe()
        self.set_links(self.clock.hops, self.clock.followers)

    def read(self, address: int, size: int) -> bytes | None:
        """Bytes at a physical address, or None where the slave refuses."""
        end = address + size
        if end > MEMORY_SIZE or not self.mailbox.readable(address, end):
            return None
        if address < DC_SYSTEM + 8 and end > DC_SYSTEM:
            self.clock.show_time()
        data = bytes(self.memory[address:end])
        if address >= 0x1000:
            self.mailbox.was_read(end)
        return data

    def write(self, address: int, data: bytes) -> bool:
        """Write bytes to a physical address, with what that causes; False where the slave refuses."""
        end = address + len(data)
        if end > MEMORY_SIZE:
            return False
        kept = [(first, bytes(self.memory[first:last])) for first, last in READ_ONLY if first < end and address < last]
        self.memory[address:end] = data
        for first, old in kept:
            self.memory[first : first + len(old)] = old
        self._react(address, end)
        return True

    def read_logical(self, fmmu: Fmmu) -> bytes:
        """Physical bytes that a reading FMMU maps, shifted to its logical bits."""
        if fmmu.plain:
            return bytes(self.memory[fmmu.physical : fmmu.physical + fmmu.end - fmmu.start])
        size = (fmmu.physical_bit + fmmu.bits + 7) // 8
        value = int.from_bytes(self.memory[fmmu.physical : fmmu.physical + size], "little") >> fmmu.physical_bit
        value = (value & ((1 << fmmu.bits) - 1)) << fmmu.first_bit
        return value.to_bytes(fmmu.end - fmmu.start, "little")

    def _describe(self) -> None:
        """Type ET1100, 8 FMMUs, 8 SyncManagers, 8 KiB; features: 64-bit distributed clocks."""
        self.memory[0:8] = bytes((0x11, 0x00, 0x02, 0x00, FMMU_COUNT, SM_COUNT, 0x08, self._ports))
        U16.pack_into(self.memory, 0x0008, 0x01CC)
        U16.pack_into(self.memory, SII_CONTROL, sii.EIGHT_BYTES)

    def _react(self, address: int, end: int) -> None:
        if address <= AL_CONTROL < end:
            self.states.request()
            if self.states.state == INIT:
                self.mailbox.reset()
        if address < SII_CONTROL + 2 and end > SII_CONTROL:
            sii.serve(self.memory, self._eeprom)
        if address < SM + 8 * SM_COUNT and end > FMMU:
            self._map()
        if address < DC_RECEIVE + 4 and end > DC_RECEIVE:
            self.clock.latch()
        if address <= DC_ACTIVATION < end:
            self.clock.activate()
        self.mailbox.was_written(address, end)

    def _map(self) -> None:
        inputs = U16.unpack_from(self.memory, INPUTS)[0]
        self.fmmus = [fmmu for k in range(FMMU_COUNT) if (fmmu := self._fmmu(FMMU + 16 * k, inputs))]

    def _fmmu(self, base: int, inputs: int) -> Fmmu | None:
        memory = self.memory
        if not memory[base + 12] & 0x01:
            return None
        start, length = U32.unpack_from(memory, base)[0], U16.unpack_from(memory, base + 4)[0]
        bits = 8 * (length - 1) + memory[base + 7] - memory[base + 6] + 1
        physical, kind = U16.unpack_from(memory, base + 8)[0], memory[base + 11]
        place = (start, start + length, memory[base + 6], bits, physical, memory[base + 10])
        return Fmmu(*place, bool(kind & 1), bool(kind & 2), bool(inputs) and physical == inputs)
