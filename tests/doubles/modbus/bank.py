"""What the double serves: registers behind a unit identifier."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from typing import Protocol, runtime_checkable

ILLEGAL_FUNCTION = 1
ILLEGAL_ADDRESS = 2
ILLEGAL_VALUE = 3
NO_RESPONSE_BEHIND_GATEWAY = 0x0B
REGISTERS = 65536
"""Size of a table of registers: an address has 16 bits."""


class ModbusFault(Exception):  # noqa: N818
    """The device answers with an exception of this code (Modbus Application Protocol V1.1b3, section 7)."""

    def __init__(self, code: int) -> None:
        super().__init__(f"Modbus exception {code}")
        self.code = code


@runtime_checkable
class RegisterBank(Protocol):
    """Registers of one unit.

    A bank may also have `read_bytes(function, address, count) -> bytes` (big-endian, 2 * count bytes; preferred by the
    double), `write(address, values)` (functions 6 and 16) and an attribute `stale` (True: the registers are frozen).
    """

    def read(self, function: int, address: int, count: int) -> list[int]:
        """`count` register values 0..65535 from `address`. Raises ModbusFault with the exception code."""
        ...


def read_bytes(bank: RegisterBank, function: int, address: int, count: int) -> bytes:
    """The registers as they go onto the wire: 2 * `count` bytes, high byte first. Raises ModbusFault."""
    fast: Callable[[int, int, int], bytes] | None = getattr(bank, "read_bytes", None)
    if fast is not None:
        return fast(function, address, count)
    return b"".join(value.to_bytes(2, "big") for value in bank.read(function, address, count))


def write(bank: RegisterBank, address: int, values: Sequence[int]) -> None:
    """Write registers. Raises ModbusFault: with code 2 where the bank can only be read."""
    writer: Callable[[int, Sequence[int]], None] | None = getattr(bank, "write", None)
    if writer is None:
        raise ModbusFault(ILLEGAL_ADDRESS)
    writer(address, values)


class PlainBank:
    """Registers `start` .. `start` + n - 1 that can be read by functions 3 and 4 and written."""

    def __init__(self, values: Sequence[int], start: int = 0) -> None:
        self.start = start
        self.stale = False
        self._values = list(values)
        self._frozen: list[int] | None = None
        self._lock = threading.Lock()

    def _offset(self, address: int, count: int) -> int:
        offset = address - self.start
        if offset < 0 or offset + count > len(self._values):
            raise ModbusFault(ILLEGAL_ADDRESS)
        return offset

    def read(self, function: int, address: int, count: int) -> list[int]:
        """Registers; while `stale` is True those of the first read after it was set."""
        offset = self._offset(address, count)
        with self._lock:
            if not self.stale:
                self._frozen = None
            elif self._frozen is None:
                self._frozen = list(self._values)
            source = self._values if self._frozen is None else self._frozen
            return source[offset : offset + count]

    def write(self, address: int, values: Sequence[int]) -> None:
        """Write registers, all or none."""
        offset = self._offset(address, len(values))
        with self._lock:
            self._values[offset : offset + len(values)] = values
