"""An energy register that only rises, and no faster than a load could make it.

What falls or leaps for a moment is no reading; what stays is another meter, or one that has been reset, and the energy
is continued. A register that rises faster than any load at these voltages and currents counts in another unit.
"""

from __future__ import annotations

from dataclasses import dataclass

INVALID = "invalid"
"""Flag of a row with values that were no measurements."""
RESET = "meter_reset"
"""Flag of the row in which the energy of a reset or exchanged meter is continued."""
CONFIRM_NS, CONFIRM_ROUNDS = 10_000_000_000, 4
"""So long, and in so many rounds, a register must stay at another value to be believed."""
_STEP = 2e-6  # relative; float32 counters step by 1.2e-7, and some meters round down for a moment
_JUMP_kWh = 1.0
_JUMP_POWER = 20.0  # times the largest apparent power seen, plus 10 kW: faster no counter rises
_OTHER_UNIT = 4.0
"""Times that much, within an hour: the register counts in another unit than it should, Wh for kWh above all."""
_HOUR_NS = 3_600_000_000_000


@dataclass(slots=True)
class Counter:
    """One energy register."""

    first: float | None = None
    """Reading before the first accepted one: both must agree, because either may be no measurement."""
    last: float | None = None
    """Last accepted reading of the register [kWh]."""
    at_ns: int = 0
    since: tuple[float, int] = (0.0, 0)
    """Reading and time of up to an hour ago, from which on it has risen no faster than a load could make it."""
    leapt_ns: int | None = None
    """When another, higher reading was believed."""
    too_fast: bool = False
    offset: float = 0.0
    """What earlier meters or registers counted [kWh]."""
    doubt: float | None = None
    """First reading that does not follow `last`."""
    since_ns: int = 0
    rounds: int = 0

    def feed(self, value: float, now_ns: int, most_VA: float, *, may_be_zero: bool, flags: set[str]) -> float | None:
        """The energy that a reading stands for; null while it is in doubt.

        `most_VA`: largest apparent power seen. `may_be_zero`: a first reading of 0 needs no confirmation.
        """
        certain = value > 0 or may_be_zero or self._confirmed(now_ns)
        if self.last is None and self.first is not None:
            certain = _continues(self.first, value, 0.0, most_VA)
            self.first = value
        fresh = self.last is None and certain
        hours = max(now_ns - self.at_ns, 0) / _HOUR_NS
        if fresh or (self.last is not None and _continues(self.last, value, hours, most_VA)):
            self.last = value if self.last is None else max(value, self.last)
            if fresh:
                self.since = (self.last, now_ns)
            self.at_ns, self.doubt = now_ns, None
            return None if self._rises_too_fast(most_VA, flags) else self.offset + self.last
        flags.add(INVALID)
        # The first reading of a meter that boots may be 0, as well: then what follows would be a jump.
        if self.doubt is None or value < self.doubt * (1 - _STEP) - 1e-3:
            self.doubt, self.since_ns, self.rounds = value, now_ns, 0
        self.rounds += 1
        if self.last is None or not self._confirmed(now_ns):
            return None
        assert self.doubt is not None  # else nothing is confirmed
        if self.doubt > self.last and self.leapt_ns is not None and now_ns - self.leapt_ns < _HOUR_NS:
            self.too_fast = True  # nobody exchanges a meter twice an hour
            self.last, self.at_ns, self.doubt, self.leapt_ns = value, now_ns, None, now_ns
            return None
        flags.discard(INVALID)
        flags.add(RESET)
        if self.doubt > self.last:
            self.leapt_ns = now_ns
        self.offset += self.last - self.doubt
        self.last, self.at_ns, self.doubt = max(value, self.doubt), now_ns, None
        self.since, self.too_fast = (self.last, now_ns), False
        return self.offset + self.last

    def _rises_too_fast(self, most_VA: float, flags: set[str]) -> bool:
        """Whether it has risen so since `since`, a reading that is renewed every hour unless it does."""
        assert self.last is not None
        before, at_ns = self.since
        most = _OTHER_UNIT * _most(max(self.at_ns - at_ns, 0) / _HOUR_NS, most_VA)
        self.too_fast = self.last - before > most + _STEP * before
        if self.too_fast:
            flags.add(INVALID)
        elif self.at_ns - at_ns > _HOUR_NS:
            self.since = (self.last, self.at_ns)
        return self.too_fast

    def _confirmed(self, now_ns: int) -> bool:
        long = now_ns - self.since_ns >= CONFIRM_NS
        return self.doubt is not None and long and self.rounds >= CONFIRM_ROUNDS


def _continues(before: float, value: float, hours: float, most_VA: float) -> bool:
    """Whether a reading may come so many hours after another one."""
    return -(1e-3 + _STEP * before) <= value - before <= _most(hours, most_VA) + _STEP * before


def _most(hours: float, most_VA: float) -> float:
    return _JUMP_kWh + hours * (10.0 + _JUMP_POWER * most_VA / 1000)
