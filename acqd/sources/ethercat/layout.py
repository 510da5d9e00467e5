"""Where the parts of a block lie in a terminal's process image, from the mapping that the terminal itself reports."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from acqd.errors import UserError
from acqd.sources.ethercat import objects

_HALF = 1 << 31
ReadMapping = Callable[[int], list[int]]
"""Entries of a PDO mapping object: index << 16 | subindex << 8 | bits each."""


@dataclass(frozen=True, slots=True)
class Block:
    """What one terminal delivers for one SYNC1 period."""

    samples: NDArray[np.int16]
    """[6, N] in the order U1, I1, U2, I2, U3, I3."""
    next_sync1_ns: int
    """DC time at which the next block begins; 0 while the terminal has no samples yet."""
    count: int
    """SampleCount: of SYNC1 periods or of samples, modulo 2^(8 x its bytes)."""
    status: NDArray[np.uint16]
    """[6] status words."""
    fine_range: int | None
    """Bit k: current channel k is in the 1 A range; None where the terminal does not report its range."""


@dataclass(frozen=True, slots=True)
class BlockLayout:
    """Byte positions in the process image of one terminal."""

    size: int
    status: tuple[int, ...]
    samples: tuple[int, ...]
    oversampling: int
    next_sync1: tuple[int, int]
    """Position and bytes (8, or 4 on terminals that send the low half only)."""
    count: tuple[int, int]
    """Position and bytes."""
    fine_range: tuple[int, int] | None
    """Position and bytes; None where the terminal does not report its range."""

    def stamp(self, image: bytes) -> bytes:
        """The bytes that differ from block to block whatever the samples are: NextSync1Time."""
        at, width = self.next_sync1
        return image[at : at + width]

    def decode(self, image: bytes, dc_time_ns: int) -> Block:
        """The parts of one process image of `size` bytes that arrived at DC time `dc_time_ns`."""
        samples = [np.frombuffer(image, "<i2", self.oversampling, position) for position in self.samples]
        return Block(
            np.array(samples, dtype=np.int16),
            self._next_sync1(image, dc_time_ns),
            _number(image, self.count),
            np.array([int.from_bytes(image[p : p + 2], "little") for p in self.status], dtype=np.uint16),
            None if self.fine_range is None else _number(image, self.fine_range),
        )

    def _next_sync1(self, image: bytes, dc_time_ns: int) -> int:
        """NextSync1Time in 64 bits: a terminal that sends the low half means the value nearest to now."""
        value = int.from_bytes(self.stamp(image), "little")
        if self.next_sync1[1] == 8 or not value:
            return value
        return dc_time_ns + (value - dc_time_ns + _HALF) % (2 * _HALF) - _HALF


def build_layout(assigned: list[int], read_mapping: ReadMapping) -> BlockLayout:
    """The layout of the assigned PDOs. Raises UserError when a part is missing or has an odd size."""
    bits = 0
    position: dict[int, tuple[int, int, int]] = {}  # PDO -> first bit, bits, entries
    for pdo in assigned:
        entries = read_mapping(pdo)
        size = sum(entry & 0xFF for entry in entries)
        position[pdo] = (bits, size, len(entries))
        bits += size
    if bits % 8:
        raise UserError(f"the EL3783 reports a process image of {bits} bits, which is no whole number of bytes")

    def wide(pdo: int, allowed: tuple[int, ...]) -> tuple[int, int]:
        return place(pdo, allowed), position[pdo][1] // 8

    def place(pdo: int, allowed: tuple[int, ...]) -> int:
        first, size, _ = position.get(pdo, (0, 0, 0))
        if size not in allowed or first % 8:
            raise UserError(
                f"the EL3783 maps PDO {pdo:#06x} with {size} bits, expected {' or '.join(map(str, allowed))}: "
                "another firmware? Report the output of acqd ethercat scan --pdos"
            )
        return first // 8

    samples = [pdo for pdo in assigned if _is_samples(pdo)]
    oversampling = position[samples[0]][1] // 16 if samples else 0
    if len(samples) != objects.CHANNELS or not oversampling:
        raise UserError(f"the EL3783 assigns {len(samples)} PDOs of samples, expected {objects.CHANNELS}")
    return BlockLayout(
        size=bits // 8,
        status=tuple(place(objects.STATUS_PDO + objects.CHANNEL_STEP * c, (16,)) for c in range(objects.CHANNELS)),
        samples=tuple(place(pdo, (16 * oversampling,)) for pdo in samples),
        oversampling=oversampling,
        next_sync1=wide(objects.NEXT_SYNC1_PDO, (32, 64)),
        count=wide(objects.SAMPLE_COUNT_PDO, (8, 16, 32)),
        fine_range=wide(objects.RANGE_PDO, (8, 16, 24, 32)) if objects.RANGE_PDO in position else None,
    )


def _number(image: bytes, place: tuple[int, int]) -> int:
    at, width = place
    return int.from_bytes(image[at : at + width], "little")


def _is_samples(pdo: int) -> bool:
    channel, kind = divmod(pdo - objects.STATUS_PDO, objects.CHANNEL_STEP)
    return 0 <= channel < objects.CHANNELS and kind > 0
