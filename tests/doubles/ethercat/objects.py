"""Object dictionary of the EL3783: PDO mappings, the assignment 0x1C13 and the range setting."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Final, Literal

from .dictionary import (
    COUNT_NOT_ZERO,
    NO_SUBINDEX,
    NOT_MAPPABLE,
    VALUE_RANGE,
    WRONG_LENGTH,
    WRONG_STATE,
    Dictionary,
    SdoAbort,
)
from .registers import U16, U32
from .sii import Identity
from .states import PREOP

FACTORS: Final = (1, 2, 4, 5, 8, 10, 16, 20, 25, 32, 40, 50, 64, 80, 100)
"""Oversampling factors; the samples PDO of factor FACTORS[j] of channel c is 0x1A01 + 0x10 * c + j."""
CHANNELS: Final = 6
NEXT_SYNC1_TIME, SAMPLE_COUNT, DIAGNOSIS, CURRENT_RANGE = 0x1A60, 0x1A61, 0x1A62, 0x1A63
ASSIGNMENT: Final = 0x1C13
RANGE: Final = 0xF800
RANGE_5A, RANGE_1A, RANGE_AUTO = 0, 1, 2
DEFAULT_ASSIGNMENT: Final = (
    *(index for channel in range(CHANNELS) for index in (0x1A00 + 0x10 * channel, 0x1A01 + 0x10 * channel)),
    NEXT_SYNC1_TIME,
)
"""Assumed: status and one sample of each channel, and the block's time."""
MAXIMUM: Final = 32
"""Most entries that 0x1C13 takes (assumed)."""

STATUS_BITS: Final = ((1, 1), (2, 1), (3, 2), (5, 2), (7, 1), (0, 6), (0x0E, 1), (0x0F, 1), (0x10, 1))
"""(subindex, bits) of a status word; subindex 0 is padding."""


@dataclass(frozen=True)
class Firmware:
    """What no document says, and a terminal may do otherwise."""

    time_words: int = 4
    """Words of NextSync1Time: 4, or 2 for its low half."""
    scalar_words: int = 1
    """Words of SampleCount, diagnosis and range."""
    counts: Literal["blocks", "samples", "nothing"] = "blocks"
    says_range: bool = True
    """Whether the PDO of the range exists."""


class TerminalObjects(Dictionary):
    """All objects of one terminal; `state` tells its present state, on which writing depends."""

    def __init__(self, identity: Identity, state: Callable[[], int], firmware: Firmware) -> None:
        super().__init__()
        self._state = state
        self._identity, self._firmware = identity, firmware
        self.reset()

    def reset(self) -> None:
        """Values after power-on."""
        self._describe()
        for index, entries in mappings(self._firmware):
            self.array(index, (U32.pack(entry) for entry in entries))
        self.array(0x1C00, (bytes((kind,)) for kind in (1, 2, 3, 4)))
        self.array(0x1C12, ())
        self.array(ASSIGNMENT, (U16.pack(index) for index in DEFAULT_ASSIGNMENT))
        self.array(RANGE, (bytes((RANGE_5A,)),))

    def assignment(self) -> list[int]:
        """Indices of the assigned PDOs, in their order."""
        entries = self._objects[ASSIGNMENT]
        return [U16.unpack(entries[k])[0] for k in range(1, entries[0][0] + 1)]

    def range_setting(self) -> int:
        """RANGE_5A, RANGE_1A or RANGE_AUTO."""
        return self._objects[RANGE][1][0]

    def write(self, index: int, subindex: int, data: bytes) -> None:
        """Take a part of the assignment (PRE-OP only) or the range setting. Raises SdoAbort."""
        if index == ASSIGNMENT:
            self._write_assignment(subindex, data)
        elif index == RANGE and subindex == 1:
            self._write_range(data)
        else:
            super().write(index, subindex, data)

    def write_all(self, index: int, data: bytes) -> None:
        """Take the whole assignment: the count in two bytes, then the indices. Raises SdoAbort."""
        if index != ASSIGNMENT:
            super().write_all(index, data)
        count = data[0] if data else 0
        if len(data) != 2 + 2 * count:
            raise SdoAbort(WRONG_LENGTH)
        self._write_assignment(0, b"\0")
        for k in range(1, count + 1):
            self._write_assignment(k, data[2 * k : 2 * k + 2])
        self._write_assignment(0, bytes((count,)))

    def _describe(self) -> None:
        identity = self._identity
        numbers = (identity.vendor, identity.product, identity.revision, identity.serial)
        self.variable(0x1000, U32.pack(0x00001389))
        self.variable(0x1008, identity.name.encode("ascii"))
        self.array(0x1018, (U32.pack(number) for number in numbers))

    def _write_range(self, data: bytes) -> None:
        if len(data) != 1:
            raise SdoAbort(WRONG_LENGTH)
        if data[0] > RANGE_AUTO:
            raise SdoAbort(VALUE_RANGE)
        self._objects[RANGE][1] = data

    def _write_assignment(self, subindex: int, data: bytes) -> None:
        if self._state() != PREOP:
            raise SdoAbort(WRONG_STATE)
        if len(data) != (2 if subindex else 1):
            raise SdoAbort(WRONG_LENGTH)
        if subindex:
            self._write_pdo(subindex, data)
        else:
            self._write_count(data[0])

    def _write_pdo(self, subindex: int, data: bytes) -> None:
        entries = self._objects[ASSIGNMENT]
        if entries[0][0]:
            raise SdoAbort(COUNT_NOT_ZERO)
        if subindex > MAXIMUM:
            raise SdoAbort(NO_SUBINDEX)
        pdo = U16.unpack(data)[0]
        if not 0x1A00 <= pdo <= CURRENT_RANGE or (pdo == CURRENT_RANGE and not self._firmware.says_range):
            raise SdoAbort(NOT_MAPPABLE)
        entries[subindex] = data

    def _write_count(self, count: int) -> None:
        entries = self._objects[ASSIGNMENT]
        if any(k not in entries for k in range(1, count + 1)):
            raise SdoAbort(VALUE_RANGE)
        indices = [entries[k] for k in range(1, count + 1)]
        if len(set(indices)) != count:
            raise SdoAbort(NOT_MAPPABLE)
        self._objects[ASSIGNMENT] = {0: bytes((count,)), **dict(enumerate(indices, start=1))}


def mappings(firmware: Firmware) -> Iterator[tuple[int, list[int]]]:
    """Index and entries (object, subindex, bits as one number) of every PDO mapping object."""
    for channel in range(CHANNELS):
        base = 0x10 * channel
        yield 0x1A00 + base, [_entry(0x6000 + base if sub else 0, sub, bits) for sub, bits in STATUS_BITS]
        for j, factor in enumerate(FACTORS):
            yield 0x1A01 + base + j, [_entry(0x6002 + base, k, 16) for k in range(1, factor + 1)]
    yield NEXT_SYNC1_TIME, [_entry(0x6060, 1, 16 * firmware.time_words)]
    for index in (SAMPLE_COUNT, DIAGNOSIS, CURRENT_RANGE):
        yield index, [_entry(0x6000 + index - 0x1A00, 1, 16 * firmware.scalar_words)]


def _entry(index: int, subindex: int, bits: int) -> int:
    return index << 16 | subindex << 8 | bits
