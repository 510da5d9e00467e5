"""Datagrams of one frame on their way through the slaves (ETG.1000.4, 5.4)."""

from __future__ import annotations

from collections.abc import Sequence
from struct import Struct
from typing import Final, NamedTuple

from .esc import Fmmu, SlaveController
from .registers import U16

FIRST: Final = 16
"""First datagram's place: Ethernet header 14 bytes, EtherCAT header 2 bytes."""
HEADER: Final = Struct("<BBHHHH")
MORE: Final = 0x8000

READ, WRITE = 1, 2
ACCESS: Final = {1: READ, 2: WRITE, 3: 3, 4: READ, 5: WRITE, 6: 3, 7: READ, 8: WRITE, 9: 3, 13: READ, 14: READ}
"""APRD APWR APRW FPRD FPWR FPRW BRD BWR BRW ARMW FRMW: what the addressed slave does."""
FIXED: Final = frozenset({4, 5, 6, 14})
BROADCAST: Final = frozenset({7, 8, 9})
MULTIPLE_WRITE: Final = frozenset({13, 14})
LRD, LWR, LRW = 10, 11, 12


class Datagram(NamedTuple):
    """Header of one datagram and the place of its data."""

    command: int
    address: int
    offset: int
    data: int
    size: int

    @property
    def logical(self) -> int:
        """32-bit logical address."""
        return self.address | self.offset << 16


def parse(frame: bytearray, length: int) -> list[Datagram]:
    """Datagrams of a frame of `length` bytes; those that do not fit in it are left out."""
    found: list[Datagram] = []
    place = FIRST
    while place + HEADER.size + 2 <= length:
        command, _, address, offset, word, _ = HEADER.unpack_from(frame, place)
        size = word & 0x07FF
        if place + HEADER.size + size + 2 > length:
            break
        found.append(Datagram(command, address, offset, place + HEADER.size, size))
        place += HEADER.size + size + 2
        if not word & MORE:
            break
    return found


def execute(frame: bytearray, datagrams: Sequence[Datagram], slaves: Sequence[SlaveController]) -> None:
    """Let every datagram pass all slaves in order: data and working counter change in `frame`."""
    for datagram in datagrams:
        if datagram.command in ACCESS:
            worked = _physical(frame, datagram, slaves)
        elif LRD <= datagram.command <= LRW:
            worked = _logical(frame, datagram, slaves)
        else:
            continue
        place = datagram.data + datagram.size
        U16.pack_into(frame, place, (U16.unpack_from(frame, place)[0] + worked) & 0xFFFF)


def _physical(frame: bytearray, datagram: Datagram, slaves: Sequence[SlaveController]) -> int:
    command, address = datagram.command, datagram.address
    worked = 0
    for position, slave in enumerate(slaves):
        if command in BROADCAST:
            hit = True
        elif command in FIXED:
            hit = slave.station == address
        else:
            hit = (address + position) & 0xFFFF == 0
        if hit:
            worked += _exchange(frame, datagram, slave, ACCESS[command])
        elif command in MULTIPLE_WRITE:
            worked += _exchange(frame, datagram, slave, WRITE)
    if command not in FIXED:
        U16.pack_into(frame, datagram.data - 8, (address + len(slaves)) & 0xFFFF)
    return worked


def _exchange(frame: bytearray, datagram: Datagram, slave: SlaveController, access: int) -> int:
    start, end = datagram.data, datagram.data + datagram.size
    incoming = bytes(frame[start:end])
    worked = 0
    if access & READ:
        value = slave.read(datagram.offset, datagram.size)
        if value is not None:
            frame[start:end] = _either(incoming, value) if datagram.command in BROADCAST else value
            worked += 1
    if access & WRITE and slave.write(datagram.offset, incoming):
        worked += 2 if access & READ else 1
    return worked


def _either(one: bytes, other: bytes) -> bytes:
    return (int.from_bytes(one, "little") | int.from_bytes(other, "little")).to_bytes(len(one), "little")


def _logical(frame: bytearray, datagram: Datagram, slaves: Sequence[SlaveController]) -> int:
    first = datagram.logical
    worked = 0
    for slave in slaves:
        done = 0
        for fmmu in slave.fmmus:
            if fmmu.start >= first + datagram.size or fmmu.end <= first or (fmmu.inputs and not slave.inputs_open):
                continue
            if fmmu.reads and datagram.command != LWR:
                _read(frame, datagram, slave, fmmu)
                done |= 1
            if fmmu.writes and datagram.command != LRD and _write(frame, datagram, slave, fmmu):
                done |= 2
        worked += (done & 1) + (done >> 1) * (2 if datagram.command == LRW else 1)
    return worked


def _read(frame: bytearray, datagram: Datagram, slave: SlaveController, fmmu: Fmmu) -> None:
    """Put the mapped bytes into the part of the frame that they share; bits leave their neighbours alone."""
    place, first, last = _shared(datagram, fmmu)
    part = slave.read_logical(fmmu)[first:last]
    if not fmmu.plain:
        part = _either(bytes(frame[place : place + len(part)]), part)
    frame[place : place + len(part)] = part


def _write(frame: bytearray, datagram: Datagram, slave: SlaveController, fmmu: Fmmu) -> bool:
    """Write the mapped bytes; no slave of this segment has outputs that are mapped by bits."""
    place, first, last = _shared(datagram, fmmu)
    return fmmu.plain and slave.write(fmmu.physical + first, bytes(frame[place : place + last - first]))


def _shared(datagram: Datagram, fmmu: Fmmu) -> tuple[int, int, int]:
    """Place in the frame of the bytes that both share, and their range counted from the mapping's start."""
    first = max(fmmu.start, datagram.logical)
    last = min(fmmu.end, datagram.logical + datagram.size)
    return datagram.data + first - datagram.logical, first - fmmu.start, last - fmmu.start
