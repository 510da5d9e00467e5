"""Dips, swells and interruptions of one to three phases, from values in the order of time."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

from acqd.metering.quality.event import Kind


class Change(NamedTuple):
    """Sample numbers at which the voltage of a phase fell and rose, if it did."""

    fell: float
    rose: float


@dataclass(slots=True)
class Open:
    """An event that goes on."""

    kind: Kind
    begin: float
    phases: set[int]
    extreme: float
    reference: float
    number: int = -1
    utc_ns: int = 0
    flags: set[str] = field(default_factory=set)


class Excursion:
    """One kind of event: phases cross a threshold, and come back by more than the hysteresis.

    Polyphase rules of IEC 61000-4-30: a dip (swell) begins with the first phase below (above) and ends when the last
    one is back; an interruption begins when all are below and ends with the first that is back.
    """

    def __init__(self, kind: Kind, phases: int, enter: float, leave: float) -> None:
        """`enter`, `leave`: shares of the reference voltage."""
        self._kind, self._phases = kind, phases
        self._enter, self._leave = enter, leave
        self._sign = 1.0 if kind == "swell" else -1.0
        self._out: dict[int, tuple[float, float]] = {}  # extreme and reference of the phases beyond the threshold
        self.open: Open | None = None
        self.end = 0.0
        """Sample number at which the event that is over has ended."""

    def take(self, phase: int, change: Change, U: float, reference: float) -> bool:
        """The next value [V] of a phase, and when that phase changed, if it did: True when the event is over."""
        into, back = (change.rose, change.fell) if self._sign > 0 else (change.fell, change.rose)
        if phase in self._out:
            if self._sign * (U - self._leave * reference) <= 0:
                del self._out[phase]
        elif self._sign * (U - self._enter * reference) > 0:
            self._out[phase] = (U, reference)
        if self.open is None:
            if len(self._out) >= (self._phases if self._kind == "interruption" else 1):
                lowest = min(self._out.values(), key=lambda pair: -self._sign * pair[0] / pair[1])
                self.open = Open(self._kind, into, set(self._out), *lowest)
        elif phase in self._out:
            self.open.phases.add(phase)
        if self.open is None:
            return False
        if phase in self._out and self._sign * (U / reference - self.open.extreme / self.open.reference) > 0:
            self.open.extreme, self.open.reference = U, reference
        self.end = max(back, self.open.begin)
        return len(self._out) < (self._phases if self._kind == "interruption" else 1)

    def idle(self, U: float, reference: float) -> bool:
        """Whether the next value [V] of a phase changes nothing: no phase is or gets beyond the threshold."""
        return not self._out and self.open is None and self._sign * (U - self._enter * reference) <= 0

    def close(self) -> Open:
        """The event that is over."""
        assert self.open is not None
        over, self.open = self.open, None
        return over

    def restart(self) -> None:
        """Forget which phases are beyond the threshold."""
        self._out.clear()
