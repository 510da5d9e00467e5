"""Which reads fetch all quantities of a profile: as few as the meter permits."""

from __future__ import annotations

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


def make_plan(profile: Profile, gap: int = GAP) -> Plan:
    """Neighbouring registers are read together, across at most `gap` others."""
    return Plan(tuple(_merged(profile.quantities.values(), profile.most_registers, gap)))


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
