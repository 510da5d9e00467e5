"""Answers of the PLC to read, write and read-write requests, by index group and offset."""

from __future__ import annotations

import struct

from tests.doubles.ads.ring import HEAD, Ring
from tests.doubles.ads.symbols import (
    HEAD_OFFSET,
    SLOTS_OFFSET,
    VARIABLES_OFFSET,
    VARIABLES_SIZE,
    Symbol,
    SymbolTable,
    other_symbols,
    ring_symbols,
)
from tests.doubles.ads.wire import AdsError, Code, Group

_NEWEST_OFFSET = HEAD_OFFSET + HEAD.itemsize - 8
_U32 = struct.Struct("<I")
_SUM_ITEM = struct.Struct("<III")


class PlcMemory:
    """The ring and two other variables, as an ADS client sees them."""

    def __init__(self, ring: Ring) -> None:
        self.ring = ring
        self.symbols = SymbolTable(ring_symbols(ring.slots, ring.slot_type.itemsize), other_symbols())
        self._variables = bytearray(VARIABLES_SIZE)

    def read(self, group: int, offset: int, length: int, now: float, *, observe: bool = False) -> bytes:
        """`length` bytes, or fewer where the data end before; raises AdsError.

        `observe`: the PLC reads its own variable for a notification. That does not advance
        lockstep time and does not use up a torn slot.
        """
        match group:
            case Group.MEMORY | Group.VALUE_BY_HANDLE:
                return self._read_variable(*self._place(group, offset, length), length, now, observe=observe)
            case Group.UPLOAD:
                return self.symbols.upload()[1][:length]
            case Group.UPLOAD_INFO | Group.UPLOAD_INFO_2:
                return self._upload_info()[:length] if group == Group.UPLOAD_INFO_2 else self._upload_info()[:8]
        raise AdsError(Code.INVALID_GROUP)

    def write(self, group: int, offset: int, data: bytes) -> None:
        """Raises AdsError; the ring is read-only."""
        if group == Group.RELEASE_HANDLE:
            self.symbols.release(_handle(data))
            return
        if group not in (Group.MEMORY, Group.VALUE_BY_HANDLE):
            raise AdsError(Code.INVALID_GROUP)
        place, symbol = self._place(group, offset, len(data))
        if not symbol.name.startswith("MAIN."):
            raise AdsError(Code.ACCESS_DENIED)
        self._variables[place - VARIABLES_OFFSET : place - VARIABLES_OFFSET + len(data)] = data

    def read_write(self, group: int, offset: int, length: int, data: bytes, now: float) -> bytes:
        """The bytes read, at most `length`; raises AdsError."""
        match group:
            case Group.HANDLE_BY_NAME:
                answer = _U32.pack(self.symbols.open(_name(data)))
            case Group.INFO_BY_NAME:
                symbol = self.symbols.by_name(_name(data))
                answer = _SUM_ITEM.pack(Group.MEMORY, symbol.offset, symbol.size)
            case Group.INFO_BY_NAME_EX:
                answer = self.symbols.by_name(_name(data)).entry()
            case Group.SUM_READ:
                answer = self._sum_read(offset, data, now)
            case Group.SUM_WRITE:
                answer = self._sum_write(offset, data)
            case _:
                raise AdsError(Code.INVALID_GROUP)
        if len(answer) > length:
            raise AdsError(Code.INVALID_SIZE)
        return answer

    def _place(self, group: int, offset: int, length: int) -> tuple[int, Symbol]:
        """Index offset and variable of an access; raises AdsError 0x705 beyond the variable's end."""
        if group == Group.VALUE_BY_HANDLE:
            symbol = self.symbols.by_handle(offset)
            offset = symbol.offset
        else:
            symbol = self.symbols.at(offset)
        if offset + length > symbol.offset + symbol.size:
            raise AdsError(Code.INVALID_SIZE)
        return offset, symbol

    def _read_variable(self, offset: int, symbol: Symbol, length: int, now: float, *, observe: bool) -> bytes:
        if symbol.offset == SLOTS_OFFSET:
            return self.ring.slot_bytes(offset - SLOTS_OFFSET, length, now, may_tear=not observe)
        if symbol.offset < HEAD_OFFSET:
            start = offset - VARIABLES_OFFSET
            return bytes(self._variables[start : start + length])
        if offset + length > _NEWEST_OFFSET and not observe:
            self.ring.clock.head_was_read()
        return self.ring.head(now)[offset - HEAD_OFFSET :][:length]

    def _upload_info(self) -> bytes:
        """AdsSymbolUploadInfo2: count and size of symbols; no data types."""
        count, entries = self.symbols.upload()
        return struct.pack("<6I", count, len(entries), 0, 0, 0, 0)

    def _sum_read(self, count: int, data: bytes, now: float) -> bytes:
        """Return codes of all items, then their data (zeros for an item that failed)."""
        codes, values = bytearray(), bytearray()
        for group, offset, length in _items(count, data):
            try:
                value, code = self.read(group, offset, length, now), 0
            except AdsError as error:
                value, code = b"", int(error.code)
            codes += _U32.pack(code)
            values += value.ljust(length, b"\0")
        return bytes(codes + values)

    def _sum_write(self, count: int, data: bytes) -> bytes:
        """Return codes of all items."""
        codes = bytearray()
        position = count * _SUM_ITEM.size
        for group, offset, length in _items(count, data):
            try:
                self.write(group, offset, data[position : position + length])
                codes += _U32.pack(0)
            except AdsError as error:
                codes += _U32.pack(error.code)
            position += length
        return bytes(codes)


def _items(count: int, data: bytes) -> list[tuple[int, int, int]]:
    if len(data) < count * _SUM_ITEM.size:
        raise AdsError(Code.INVALID_SIZE)
    return [_SUM_ITEM.unpack_from(data, index * _SUM_ITEM.size) for index in range(count)]


def _name(data: bytes) -> str:
    return data.split(b"\0", 1)[0].decode("cp1252")


def _handle(data: bytes) -> int:
    if len(data) != _U32.size:
        raise AdsError(Code.INVALID_SIZE)
    return int(_U32.unpack(data)[0])
