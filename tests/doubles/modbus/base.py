"""What the doubles of both transports have in common: units, faults, and a record of what was asked."""

from __future__ import annotations

from collections import Counter, deque
from collections.abc import Mapping
from typing import Literal

from tests.doubles.modbus.bank import NO_RESPONSE_BEHIND_GATEWAY, RegisterBank
from tests.doubles.modbus.wire import Request, answer, exception, request_of, shorten

Damage = Literal["garbage", "short", "cut"]
"""garbage: wrong CRC or transaction identifier; short: one register too few; cut: the frame ends in its middle."""
DAMAGES: tuple[Damage, ...] = ("garbage", "short", "cut")


class ModbusDouble:
    """Units and their faults. Each fault concerns one unit, or all of them with unit None."""

    gateway = False
    """Who asks for a unit that is not there gets exception 0x0B, as from a gateway; otherwise no answer."""

    def __init__(self, units: Mapping[int, RegisterBank]) -> None:
        self.units = dict(units)
        self.requests: Counter[int] = Counter()
        """Requests received, by unit."""
        self.seen: deque[Request] = deque(maxlen=4096)
        """The last requests, oldest first."""
        self.latency_s = 0.0
        self._exceptions: dict[int | None, int] = {}
        self._silent: set[int | None] = set()
        self._damages: deque[tuple[Damage, int | None]] = deque()

    def set_latency(self, seconds: float) -> None:
        """Each answer leaves `seconds` after its request; requests do not wait for one another on TCP."""
        self.latency_s = seconds

    def set_exception(self, code: int | None, unit: int | None = None) -> None:
        """Answer each request with this exception code; None ends it."""
        if code is None:
            self._exceptions.pop(unit, None)
        else:
            self._exceptions[unit] = code

    def set_silent(self, on: bool = True, unit: int | None = None) -> None:
        """Answer nothing, as a meter without supply."""
        if on:
            self._silent.add(unit)
        else:
            self._silent.discard(unit)

    def set_stale(self, on: bool = True, unit: int | None = None) -> None:
        """Freeze the registers: the device answers, but its values no longer change."""
        for bank in self.units.values() if unit is None else [self.units[unit]]:
            if not hasattr(bank, "stale"):
                raise ValueError(f"{type(bank).__name__} cannot freeze its registers")
            bank.stale = on

    def damage_next(self, kind: Damage, count: int = 1, unit: int | None = None) -> None:
        """Damage the next `count` answers."""
        if kind not in DAMAGES:
            raise ValueError(f"{kind!r} is none of {', '.join(DAMAGES)}")
        self._damages.extend([(kind, unit)] * count)

    def _respond(self, unit: int, pdu: bytes) -> bytes | None:
        """PDU of the answer; None: there is none."""
        if self._silent and (None in self._silent or unit in self._silent):
            return None
        if self._exceptions and (code := self._exceptions.get(unit, self._exceptions.get(None))) is not None:
            return exception(pdu[0], code)
        if unit not in self.units:
            return exception(pdu[0], NO_RESPONSE_BEHIND_GATEWAY) if self.gateway else None
        return answer(self.units[unit], pdu)

    def _note(self, unit: int, pdu: bytes) -> None:
        self.requests[unit] += 1
        self.seen.append(request_of(unit, pdu))

    def _take_damage(self, unit: int) -> Damage | None:
        for entry in tuple(self._damages):
            if entry[1] in (None, unit):
                self._damages.remove(entry)
                return entry[0]
        return None

    def _damaged(self, unit: int, pdu: bytes) -> tuple[bytes, Damage | None]:
        """The PDU, one register shorter if that is the next damage, and the damage that is left for the frame."""
        kind = self._take_damage(unit) if self._damages else None
        return (shorten(pdu), None) if kind == "short" else (pdu, kind)
