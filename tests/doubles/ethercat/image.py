"""Process image of the EL3783: where each assigned PDO lies, and the bytes of one block of samples."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from .objects import CHANNELS, CURRENT_RANGE, DIAGNOSIS, FACTORS, NEXT_SYNC1_TIME, SAMPLE_COUNT, Firmware


class MappingError(ValueError):
    """An assignment that the terminal cannot serve."""


@dataclass
class Block:
    """One block as the terminal shows it.

    `codes` is int16 [samples, 6] or None, `status` one status word per channel, `next_time` the system time [ns] at
    which the next block begins.
    """

    codes: NDArray[np.int16] | None
    status: list[int]
    next_time: int = 0
    count: int = 0
    diagnosis: int = 0
    ranges: int = 0


@dataclass
class Layout:
    """Places in the image, counted in words of two bytes."""

    firmware: Firmware = field(default_factory=Firmware)
    factor: int = 1
    size: int = 0
    status: list[tuple[int, int]] = field(default_factory=list)
    samples: list[tuple[int, int]] = field(default_factory=list)
    scalars: list[tuple[int, int]] = field(default_factory=list)

    def image(self, block: Block) -> bytes:
        """The image's bytes."""
        words = np.zeros(self.size, dtype="<i2")
        unsigned = words.view("<u2")
        for place, channel in self.status:
            unsigned[place] = block.status[channel]
        if block.codes is not None:
            for place, channel in self.samples:
                words[place : place + self.factor] = block.codes[:, channel]
        for place, index in self.scalars:
            self._scalar(unsigned, place, index, block)
        return words.tobytes()

    def _scalar(self, words: NDArray[np.uint16], place: int, index: int, block: Block) -> None:
        values = {
            NEXT_SYNC1_TIME: block.next_time, SAMPLE_COUNT: block.count, DIAGNOSIS: block.diagnosis,
            CURRENT_RANGE: block.ranges,
        }  # fmt: skip
        size = self._words(index)
        low = values[index] % (1 << 16 * size)
        words[place : place + size] = np.frombuffer(low.to_bytes(2 * size, "little"), dtype="<u2")

    def _words(self, index: int) -> int:
        return self.firmware.time_words if index == NEXT_SYNC1_TIME else self.firmware.scalar_words

    def add_scalar(self, index: int) -> None:
        """The next part of the image."""
        self.scalars.append((self.size, index))
        self.size += self._words(index)


def layout(assignment: list[int], firmware: Firmware) -> Layout:
    """Places of the assigned PDOs, in their order. Raises MappingError where the factors differ."""
    found = Layout(firmware)
    factors: list[int] = []
    for index in assignment:
        channel, kind = divmod(index - 0x1A00, 0x10)
        if channel >= CHANNELS:
            found.add_scalar(index)
        elif kind == 0:
            found.status.append((found.size, channel))
            found.size += 1
        else:
            factors.append(FACTORS[kind - 1])
            found.samples.append((found.size, channel))
            found.size += factors[-1]
    if len(set(factors)) > 1:
        raise MappingError(f"the assigned channels have different oversampling factors: {sorted(set(factors))}")
    found.factor = factors[0] if factors else 1
    return found
