"""Object dictionary of a CoE slave: values as bytes, and the abort codes of a refused access (ETG.1000.6, 5.6.2.7)."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

NO_COMPLETE_ACCESS: Final = 0x06010000
READ_ONLY: Final = 0x06010002
COUNT_NOT_ZERO: Final = 0x06010003
NO_OBJECT: Final = 0x06020000
NOT_MAPPABLE: Final = 0x06040041
WRONG_LENGTH: Final = 0x06070010
NO_SUBINDEX: Final = 0x06090011
VALUE_RANGE: Final = 0x06090030
WRONG_STATE: Final = 0x08000022
WRONG_TOGGLE: Final = 0x05030000
UNKNOWN_COMMAND: Final = 0x05040001


class SdoAbort(Exception):  # noqa: N818 -- the protocol's word
    """An access that the slave refuses with an abort code."""

    def __init__(self, code: int) -> None:
        super().__init__(f"SDO abort 0x{code:08X}")
        self.code = code


class Dictionary:
    """Objects by index, each with its values by subindex."""

    def __init__(self) -> None:
        self._objects: dict[int, dict[int, bytes]] = {}

    def variable(self, index: int, value: bytes) -> None:
        """Define an object of one value."""
        self._objects[index] = {0: value}

    def array(self, index: int, values: Iterable[bytes]) -> None:
        """Define an object whose subindex 0 counts the values."""
        entries = dict(enumerate(values, start=1))
        self._objects[index] = {0: bytes((len(entries),)), **entries}

    def read(self, index: int, subindex: int) -> bytes:
        """One value. Raises SdoAbort."""
        entries = self._object(index)
        if subindex not in entries:
            raise SdoAbort(NO_SUBINDEX)
        return entries[subindex]

    def read_all(self, index: int, first: int) -> bytes:
        """All values from subindex `first` (0 or 1) on; subindex 0 takes two bytes. Raises SdoAbort."""
        entries = self._object(index)
        if len(entries) == 1:
            raise SdoAbort(NO_COMPLETE_ACCESS)
        body = b"".join(value for subindex, value in sorted(entries.items()) if subindex)
        return body if first else entries[0].ljust(2, b"\0") + body

    def write(self, index: int, subindex: int, data: bytes) -> None:
        """Refuse: the objects here are read-only. Raises SdoAbort."""
        self.read(index, subindex)
        raise SdoAbort(READ_ONLY)

    def write_all(self, index: int, data: bytes) -> None:
        """Refuse complete access. Raises SdoAbort."""
        self._object(index)
        raise SdoAbort(NO_COMPLETE_ACCESS)

    def _object(self, index: int) -> dict[int, bytes]:
        if index not in self._objects:
            raise SdoAbort(NO_OBJECT)
        return self._objects[index]
