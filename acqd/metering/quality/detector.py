"""A stream of sample blocks in, voltage events out.

A gap is never bridged: an event in which samples go missing ends there, flagged `gap`, and what continues behind the
gap is another event, flagged as well.
"""

from __future__ import annotations

import heapq
from collections.abc import Iterator

from acqd.metering.block import SampleBlock, StreamFormat
from acqd.metering.quality.event import Event, Thresholds
from acqd.metering.quality.excursion import Change, Excursion, Open
from acqd.metering.quality.half_cycle import HalfCycles, HalfCycleStream
from acqd.metering.quality.rapid_change import RapidChange
from acqd.metering.quality.reference import Reference
from acqd.metering.quality.stamp import HalfCycleLevels
from acqd.metering.quality.transient import TransientDetector


class EventDetector:
    """Watches the voltages of one stream."""

    def __init__(
        self, form: StreamFormat, reference: Reference, thresholds: Thresholds | None = None, first: int = 0
    ) -> None:
        """`first`: number of the first event."""
        limits = thresholds or Thresholds()
        self._form, self._reference = form, reference
        self._stream = HalfCycleStream(form)
        phases, slack = form.phases, limits.hysteresis
        self._excursions = [
            Excursion("dip", phases, limits.dip, limits.dip + slack),
            Excursion("swell", phases, limits.swell, limits.swell - slack),
            Excursion("interruption", phases, limits.interruption, limits.interruption + slack),
        ]
        self._change = (
            RapidChange(phases, form.f_nominal, limits.rvc, limits.rvc_hysteresis) if limits.rvc > 0 else None
        )
        self._transients = TransientDetector(form, limits.transient) if limits.transient > 0 else None
        self._levels = [HalfCycleLevels() for _ in range(phases)]
        self._number = first
        self._anchor = (0, 0)
        self._flags: frozenset[str] = frozenset()
        self._unknown: frozenset[str] = frozenset({"start"})  # why the time before is not known
        self._last = 0.0  # end of the newest value

    def feed(self, block: SampleBlock) -> Iterator[Event]:
        """Events that begin or end in what `block` completes."""
        gaps = self._unknown
        for values in self._stream.feed(block):
            if values.last:
                yield from self._interrupt("gap")
                gaps = frozenset({"gap"})
                continue
            self._anchor, self._flags = (block.index, block.utc_ns), block.flags - {"late"}
            self._unknown = gaps if values.first else frozenset()
            yield from self._take(values)
            gaps = self._unknown = frozenset()
        self._unknown = gaps
        if self._transients is not None:
            yield from self._transient(self._transients, block)

    def _transient(self, transients: TransientDetector, block: SampleBlock) -> Iterator[Event]:
        reference, cycle = self._reference.of(0), self._stream.cycle
        if reference is None or cycle is None:
            return
        self._anchor, self._flags = (block.index, block.utc_ns), block.flags - {"late"}
        for one in transients.feed(block, reference, cycle):
            kind = "oscillatory" if one.oscillatory else "impulsive"
            done = Open("transient", one.begin, one.phases, one.extreme, reference)
            self._begun(done, frozenset({kind}))
            yield self._event(done, one.end)

    def finish(self) -> Iterator[Event]:
        """The events in progress when the stream ends."""
        yield from self._interrupt("unfinished")

    def _take(self, values: HalfCycles) -> Iterator[Event]:
        if self._quiet(values):
            return
        fresh = dict.fromkeys(range(self._form.phases), bool(self._unknown))
        for one in heapq.merge(*(_listed(values, phase) for phase in range(self._form.phases))):
            end, phase, begin, U, late = one
            self._levels[phase].take(late)
            reference = self._reference.of(phase)
            if reference is not None:
                before = self._unknown if fresh[phase] else frozenset()
                yield from self._value(phase, begin, end, U, reference, before)
                fresh[phase] = False
            self._reference.take(phase, U, not self._busy)
            self._last = end

    def _quiet(self, values: HalfCycles) -> bool:
        """Take values among which nothing can happen at once, and say whether they were such; nearly all are."""
        reference = None if self._reference.sliding else self._reference.of(0)  # of all phases
        if self._unknown or reference is None or not all(len(one) for one in values.phases):
            return False
        columns = [one.T.tolist() for one in values.phases]
        bounds = [(min(U), max(U)) for _, _, U, _ in columns]
        low, high = min(low for low, _ in bounds), max(high for _, high in bounds)
        if not all(one.idle(low, reference) and one.idle(high, reference) for one in self._excursions):
            return False
        if self._change is not None and not self._change.stays_steady(bounds, reference):
            return False
        for phase, (begins, _, U, late) in enumerate(columns):
            self._levels[phase].take_all(late)
            if self._change is not None:
                self._change.take_steady(phase, begins, U)
        self._last = max(ends[-1] for _, ends, _, _ in columns)
        return True

    def _value(
        self, phase: int, begin: float, end: float, U: float, reference: float, before: frozenset[str]
    ) -> Iterator[Event]:
        if all(excursion.idle(U, reference) for excursion in self._excursions):
            if self._change is not None:
                yield from self._rapid(self._change, phase, begin, U, reference, False)
            return
        busy = self._busy
        # What is there at the first value has been there since its cycle began.
        levels, half = self._levels[phase], (end - begin) / 2
        change = Change(begin, begin) if before else Change(end - levels.fell() * half, end - levels.rose() * half)
        for excursion in self._excursions:
            was = excursion.open
            over = excursion.take(phase, change, U, reference)
            if excursion.open is not None and was is None:
                yield self._begun(excursion.open, before)
            if over:
                yield self._event(excursion.close(), excursion.end)
        if self._change is not None:
            yield from self._rapid(self._change, phase, begin, U, reference, busy or self._busy)

    @property
    def _busy(self) -> bool:
        """Whether a dip, swell or interruption is in progress."""
        return any(one.open is not None for one in self._excursions)

    def _rapid(
        self, change: RapidChange, phase: int, begin: float, U: float, reference: float, busy: bool
    ) -> Iterator[Event]:
        over = change.take(phase, begin, U, reference)
        if busy:
            change.discard()
        elif over:
            done = change.close()
            self._begun(done, frozenset())
            yield self._event(done, change.end, change.steady_change)

    def _interrupt(self, why: str) -> Iterator[Event]:
        """No more values: close what is open."""
        for excursion in self._excursions:
            if excursion.open is not None:
                excursion.open.flags.add(why)
                yield self._event(excursion.close(), self._last)
            excursion.restart()
        for levels in self._levels:
            levels.clear()
        if self._change is not None:
            self._change.restart()

    def _begun(self, one: Open, before: frozenset[str]) -> Event:
        one.number, self._number = self._number, self._number + 1
        index, utc_ns = self._anchor
        one.utc_ns = utc_ns + round((one.begin - index) * 1e9 / self._form.rate)
        one.flags |= before
        return self._event(one, None)

    def _event(self, one: Open, end: float | None, steady_change: float | None = None) -> Event:
        one.flags |= self._flags
        return Event(
            number=one.number,
            kind=one.kind,
            begin=one.begin,
            utc_ns=one.utc_ns,
            phases=tuple(sorted(one.phases)),
            extreme=one.extreme,
            reference=one.reference,
            end=end,
            duration=None if end is None else (end - one.begin) / self._form.rate,
            steady_change=steady_change,
            flags=frozenset(one.flags),
        )


def _listed(values: HalfCycles, phase: int) -> list[tuple[float, int, float, float, float]]:
    """End, phase, begin, Urms(1/2) and mean square of the second half of the values of a phase."""
    begins, ends, Urms, lates = values.phases[phase].T.tolist()
    return [(end, phase, *rest) for end, *rest in zip(ends, begins, Urms, lates, strict=True)]
