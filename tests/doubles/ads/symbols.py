"""The PLC's symbol table: names, index offsets and handles."""

from __future__ import annotations

import struct
from collections.abc import Iterable
from dataclasses import dataclass

from tests.doubles.ads.ring import HEAD
from tests.doubles.ads.wire import AdsError, Code, Group

HEAD_OFFSET = 0x5E000
"""Index offset of GVL_Acqd.stHead; any number, as in a PLC."""
SLOTS_OFFSET = 0x60000
VARIABLES_OFFSET = 0x5D000
VARIABLES_SIZE = 12
_ENTRY = struct.Struct("<IIIIIIHHH")
_ADS_TYPES = {"UINT": 18, "UDINT": 19, "ULINT": 21, "DINT": 3, "REAL": 4, "LREAL": 5}
_BIG_TYPE = 65
_HEAD_TYPES = {"u2": "UINT", "u4": "UDINT", "u8": "ULINT"}


@dataclass(frozen=True)
class Symbol:
    """A PLC variable in the index group 0x4040."""

    name: str
    type_name: str
    ads_type: int
    offset: int
    size: int

    def entry(self) -> bytes:
        """AdsSymbolEntry, as the symbol upload and 0xF009 give it."""
        texts = b"".join(text.encode("cp1252") + b"\0" for text in (self.name, self.type_name, ""))
        length = _ENTRY.size + len(texts)
        lengths = len(self.name), len(self.type_name), 0
        numbers = length, Group.MEMORY, self.offset, self.size, self.ads_type, 0
        return _ENTRY.pack(*numbers, *lengths) + texts


def ring_symbols(slots: int, slot_size: int) -> list[Symbol]:
    """The two structures of the ring and the scalar members of the head."""
    return [
        Symbol("GVL_Acqd.stHead", "ST_AcqdHead", _BIG_TYPE, HEAD_OFFSET, HEAD.itemsize),
        Symbol("GVL_Acqd.aSlots", f"ARRAY [0..{slots - 1}] OF ST_AcqdSlot", _BIG_TYPE, SLOTS_OFFSET, slots * slot_size),
        *_head_members(),
    ]


def _head_members() -> Iterable[Symbol]:
    for name, (dtype, offset, *_) in (HEAD.fields or {}).items():
        type_name = _HEAD_TYPES.get(dtype.str[1:])
        if type_name:
            place = HEAD_OFFSET + offset
            yield Symbol(f"GVL_Acqd.stHead.{name}", type_name, _ADS_TYPES[type_name], place, dtype.itemsize)


def other_symbols() -> list[Symbol]:
    """Two writable variables that do not belong to the ring."""
    return [
        Symbol("MAIN.nTest", "DINT", _ADS_TYPES["DINT"], VARIABLES_OFFSET, 4),
        Symbol("MAIN.fTest", "LREAL", _ADS_TYPES["LREAL"], VARIABLES_OFFSET + 4, 8),
    ]


class SymbolTable:
    """Symbols by name (upper and lower case are equal, as in a PLC) and by handle."""

    def __init__(self, ring: list[Symbol], others: list[Symbol]) -> None:
        self._ring = ring
        self._others = others
        self.with_ring = True
        self._handles: dict[int, str] = {}
        self._last_handle = 0x1000

    @property
    def open_handles(self) -> int:
        return len(self._handles)

    def by_name(self, name: str) -> Symbol:
        """Raises AdsError 0x710 for an unknown name."""
        for symbol in self._present():
            if symbol.name.upper() == name.upper():
                return symbol
        raise AdsError(Code.SYMBOL_NOT_FOUND)

    def open(self, name: str) -> int:
        """A new handle of the symbol `name`."""
        self._last_handle += 1
        self._handles[self._last_handle] = self.by_name(name).name
        return self._last_handle

    def by_handle(self, handle: int) -> Symbol:
        """Raises AdsError 0x710 for an unknown handle, or if the symbol does not exist any more."""
        return self.by_name(self._handles.get(handle, ""))

    def release(self, handle: int) -> None:
        if self._handles.pop(handle, None) is None:
            raise AdsError(Code.SYMBOL_NOT_FOUND)

    def at(self, offset: int) -> Symbol:
        """The variable that holds the byte at `offset`; raises AdsError 0x703 if there is none."""
        for symbol in self._present():
            if symbol.offset <= offset < symbol.offset + symbol.size:
                return symbol
        raise AdsError(Code.INVALID_OFFSET)

    def upload(self) -> tuple[int, bytes]:
        """Number of variables and their entries; members of structures have no entry."""
        entries = [symbol.entry() for symbol in self._present() if symbol.name.count(".") == 1]
        return len(entries), b"".join(entries)

    def _present(self) -> list[Symbol]:
        return [*self._ring, *self._others] if self.with_ring else self._others
