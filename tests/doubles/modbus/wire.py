"""Requests and answers of Modbus (Modbus Application Protocol V1.1b3) and the CRC of the serial line (V1.02)."""

from __future__ import annotations

import struct
from typing import NamedTuple

from tests.doubles.modbus.bank import (
    ILLEGAL_ADDRESS,
    ILLEGAL_FUNCTION,
    ILLEGAL_VALUE,
    REGISTERS,
    ModbusFault,
    RegisterBank,
    read_bytes,
    write,
)

READ_HOLDING = 3
READ_INPUT = 4
WRITE_ONE = 6
WRITE_MANY = 16
MOST_READ = 125
MOST_WRITTEN = 123


class Request(NamedTuple):
    """A request as the double saw it, for tests of what a client asks."""

    unit: int
    function: int
    address: int
    registers: int


def _crc_table() -> tuple[int, ...]:
    table = []
    for byte in range(256):
        value = byte
        for _ in range(8):
            value = (value >> 1) ^ 0xA001 if value & 1 else value >> 1
        table.append(value)
    return tuple(table)


_CRC = _crc_table()


def crc16(data: bytes) -> bytes:
    """CRC of an RTU frame, low byte first (Modbus over Serial Line V1.02, section 6.2.2)."""
    value = 0xFFFF
    for byte in data:
        value = (value >> 8) ^ _CRC[(value ^ byte) & 0xFF]
    return value.to_bytes(2, "little")


def request_of(unit: int, pdu: bytes) -> Request:
    """What a PDU asks; address and count are 0 where the function has none."""
    address, count = struct.unpack_from(">HH", pdu, 1) if len(pdu) >= 5 else (0, 0)
    return Request(unit, pdu[0], address, 1 if pdu[0] == WRITE_ONE else count)


def exception(function: int, code: int) -> bytes:
    """PDU of an exception."""
    return bytes((function | 0x80, code))


def _read(bank: RegisterBank, pdu: bytes) -> bytes:
    function, address, count = struct.unpack(">BHH", pdu)
    if not 1 <= count <= MOST_READ:
        raise ModbusFault(ILLEGAL_VALUE)
    if address + count > REGISTERS:
        raise ModbusFault(ILLEGAL_ADDRESS)
    return bytes((function, 2 * count)) + read_bytes(bank, function, address, count)


def _write_one(bank: RegisterBank, pdu: bytes) -> bytes:
    _, address, value = struct.unpack(">BHH", pdu)
    write(bank, address, [value])
    return pdu


def _write_many(bank: RegisterBank, pdu: bytes) -> bytes:
    _, address, count, size = struct.unpack_from(">BHHB", pdu)
    if not 1 <= count <= MOST_WRITTEN or size != 2 * count or len(pdu) != 6 + size:
        raise ModbusFault(ILLEGAL_VALUE)
    if address + count > REGISTERS:
        raise ModbusFault(ILLEGAL_ADDRESS)
    write(bank, address, struct.unpack_from(f">{count}H", pdu, 6))
    return pdu[:5]


def answer(bank: RegisterBank, pdu: bytes) -> bytes:
    """PDU of the answer; what the bank or the standard refuses is an exception PDU."""
    function = pdu[0]
    try:
        if function in (READ_HOLDING, READ_INPUT):
            return _read(bank, pdu)
        if function == WRITE_ONE:
            return _write_one(bank, pdu)
        if function == WRITE_MANY:
            return _write_many(bank, pdu)
    except ModbusFault as fault:
        return exception(function, fault.code)
    except struct.error:
        return exception(function, ILLEGAL_VALUE)
    return exception(function, ILLEGAL_FUNCTION)


def shorten(pdu: bytes) -> bytes:
    """Answer to a read with one register less than asked for, consistent in itself; others unchanged."""
    if pdu[0] not in (READ_HOLDING, READ_INPUT) or pdu[1] < 4:
        return pdu
    return bytes((pdu[0], pdu[1] - 2)) + pdu[2:-2]
