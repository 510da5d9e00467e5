"""Which reads fetch all quantities of a profile: as few as the meter permits."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass

from acqd.sources.meters.profile import Profile, Register
from acqd.sources.modbus.client import Read

GAP = 16
"""Registers without a quantity that one read may span; reading them costs less than another read."""


@dataclass(frozen=True, slots=True)
class Plan:
    """Reads, and which read holds which register."""

    reads: tuple[Read, ...]

    def bytes_of(self, register: Register, answers: list[bytes]) -> bytes:
        """The bytes of a register among the answers."""
        for (function, address, count), answer in zip(self.reads, answers, strict=True):
            offset = register.address - address
            if function == register.function and 0 <= offset <= count - register.width:
                return answer[2 * offset : 2 * (offset + register.width)]
        raise KeyError(register)

    def together(self, registers: Iterable[Register]) -> bool:
        """Whether one answer holds all of these registers, which are of one moment then."""
        wanted = list(registers)
        return any(
            all(one.function == function and 0 <= one.address - address <= count - one.width for one in wanted)
            for function, address, count in self.reads
        )


def make_plan(profile: Profile, gap: int = GAP) -> Plan:
    """Neighbouring registers are read together, across at most `gap` others.

    On a serial line nothing but its length tells which request an answer is for. So no two reads in a row, the first
    one after the last included, are of one length, as far as other orders and shorter reads allow that.
    """
    reads = list(_merged(profile.quantities.values(), profile.most_registers, gap))
    while _alike(reads := _mixed(reads)) and (shorter := _split(reads, profile)) is not None:
        reads = shorter
    return Plan(tuple(reads))


def _alike(reads: list[Read]) -> list[Read]:
    """Reads that have the function and length of the one before them in the round."""
    return [] if len(reads) == 1 else [one for k, one in enumerate(reads) if one[::2] == reads[k - 1][::2]]


def _mixed(reads: list[Read]) -> list[Read]:
    """The most frequent lengths at every other place, then the others between them."""
    if not _alike(reads):
        return reads
    count = Counter(one[::2] for one in reads)
    ordered = sorted(reads, key=lambda one: (-count[one[::2]], one[::2]))
    mixed = list(reads)
    mixed[0::2] = ordered[: len(mixed[0::2])]
    mixed[1::2] = ordered[len(mixed[0::2]) :]
    return mixed if len(_alike(mixed)) < len(_alike(reads)) else reads


def _split(reads: list[Read], profile: Profile) -> list[Read] | None:
    """One of the reads that are alike in two parts, of which neither cuts a register; None where that mends nothing."""
    for read in sorted(_alike(reads), key=lambda one: -one[2]):
        function, address, count = read
        same = [one for one in profile.quantities.values() if one.function == function]
        inside = {one.address - address for one in same if address < one.address < address + count}
        for at in sorted(inside, reverse=True):
            last = max(one.address + one.width for one in same if one.address < address + at)
            head: Read = (function, address, last - address)
            tail: Read = (function, address + at, count - at)
            parts = [part for one in reads for part in ((head, tail) if one == read else (one,))]
            if len(_alike(_mixed(parts))) < len(_alike(reads)):
                return parts
    return None


def _merged(registers: Iterable[Register], most: int, gap: int) -> Iterable[Read]:
    current: Read | None = None
    for register in sorted(registers, key=lambda one: (one.function, one.address)):
        if current is not None:
            function, address, count = current
            end = max(address + count, register.address + register.width)
            near = register.address - (address + count) <= gap
            if function == register.function and near and end - address <= most:
                current = (function, address, end - address)
                continue
            yield current
        current = (register.function, register.address, register.width)
    if current is not None:
        yield current
