"""10/12-cycle intervals without gaps, restarted at every UTC ten-minute tick (IEC 61000-4-30:2015, section 4.5).

10 cycles at 50 Hz, 12 at 60 Hz. An interval begins where the last one ended and holds exactly so many cycles by its
own f. While there is no voltage, or no credible f, it is as long as the last f says. At a tick the interval in
progress is finished (overlap 1 of the standard), and the next one begins at the tick. So that the 150/180-cycle
value in progress can be finished too (overlap 2), the intervals of the old chain continue in parallel with the
new ones until it is complete; they are `trailing`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from acqd.arrays import Floats
from acqd.metering.block import SampleBlock, StreamFormat
from acqd.metering.quality.coarse import coarse_f, mains_range, nominal_system
from acqd.metering.quality.cycle_sideband import CycleSideband
from acqd.metering.quality.cycles import NONE, CycleFit, fit_cycles
from acqd.metering.quality.decimate import decimated, factor_of
from acqd.metering.quality.resample import MARGIN
from acqd.metering.quality.run import SampleRun

TICK_NS = 600 * 10**9
FIFTEEN = 15
"""10/12-cycle intervals in a 150/180-cycle one."""
_AT_TICK_NS = 1_000_000
_EDGE = 0.1
"""Hz beyond the range, so that its bounds are no edges."""
_ROOM = 1.02
"""f may fall by so much from one interval to the next without a second look."""


@dataclass(frozen=True, slots=True)
class Interval:
    """One 10/12-cycle interval and its samples."""

    x: Floats
    """[channels, samples] V and A, with MARGIN before and after the interval."""
    start: float
    """Begin of the interval in `x` [samples]; sample k is the cell [k, k + 1)."""
    length: float
    """Samples."""
    rate: float
    """1/s."""
    cycles: int
    utc_ns: int
    """UTC of the start."""
    fit: CycleFit
    f: float
    """Hz: of the fit, or the last one that was known."""
    flags: frozenset[str]
    stops: Floats
    """[2, channels] V and A: end stops of the converter."""
    first_of_chain: bool
    """After a gap, at a tick, or at the start of the stream: a 150/180-cycle value begins here."""
    trailing: bool
    """Of the chain before the tick: belongs to a 150/180-cycle value only."""

    @property
    def duration(self) -> float:
        """s."""
        return self.length / self.rate


@dataclass(slots=True)
class _Chain:
    begin: float
    count: int = 0
    """Intervals cut, modulo 15."""
    trailing: bool = False
    fresh: bool = True


class IntervalCutter:
    """Cuts the intervals of one stream."""

    def __init__(self, form: StreamFormat, dead: Floats) -> None:
        """`dead` [phases]: V below which there is no voltage."""
        self._form, self._dead = form, dead
        self._stops = np.outer((form.code_min, form.code_max), form.scale)
        self.cycles = 12 if nominal_system(form.f_nominal) > 55 else 10
        self._range = mains_range(form.f_nominal)
        self._factor = factor_of(form.rate / self._range[1])
        self._margin = MARGIN * factor_of(form.rate / (self._range[0] - _EDGE)) + 1  # for any f
        self._run = SampleRun(form)
        self._chains: list[_Chain] = []  # the old one first
        self._f = form.f_nominal
        self._known = False
        self._gap = False
        self._sideband = CycleSideband(form.f_nominal)

    def feed(self, block: SampleBlock) -> Iterator[Interval]:
        """Intervals that `block` completes, in the order of their starts."""
        begun = bool(self._chains)
        if len(block.codes) and not self._run.append(block):
            self._chains = [_Chain(float(self._run.begin + self._margin))]
            self._gap = begun
            self._known = False
        while self._chains:
            chain = min(self._chains, key=lambda chain: chain.begin)
            interval = self._next(chain)
            if interval is None:
                break
            yield interval
            self._advance(chain, interval)
        if self._chains:
            self._run.forget(min(chain.begin for chain in self._chains) - self._margin - 1)

    def _next(self, chain: _Chain) -> Interval | None:
        """The next interval of a chain; None while samples are missing."""
        nominal = self.cycles * self._form.rate / self._f
        if self._run.end < chain.begin + _ROOM * nominal + self._margin:
            return None
        stretch = self._stretch(chain.begin)
        fit = self._fit(stretch, chain.begin, nominal)
        if fit is None:
            return None
        if fit.credible:
            self._f = fit.f
        self._known = fit.credible
        length = self.cycles * self._form.rate / self._f
        enough = self._run.end >= chain.begin + length + self._margin
        return self._interval(chain, length, fit, stretch) if enough else None

    def _stretch(self, begin: float) -> tuple[Floats, int]:
        """V and A of all samples that an interval from `begin` on may need, and the position of the first one."""
        longest = self.cycles * self._form.rate / (self._range[0] - _EDGE)
        return self._run.physical(begin - self._margin, begin + longest + self._margin)

    @np.errstate(invalid="ignore", over="ignore")  # samples that are no numbers give no f
    def _fit(self, stretch: tuple[Floats, int], begin: float, nominal: float) -> CycleFit | None:
        """f of the interval from `begin` on; None when it may be longer than the samples that are there."""
        longest = self.cycles * self._form.rate / (self._range[0] - _EDGE)
        x, low = _from(stretch, begin - 1)
        u, start, rate = decimated(x[0::2], self._factor), (begin - low) / self._factor, self._form.rate / self._factor
        if self._known:
            fit = self._credible(u, start, rate, self._f)
            if fit.credible:
                return fit
        if low + x.shape[1] < begin + longest + self._factor:
            return None  # it may last longer than expected
        within = u[:, int(start) : int(start + nominal / self._factor)]
        if not (within.std(axis=1) > self._dead).any():
            return NONE
        return self._credible(u, start, rate, coarse_f(within, rate, self._form.f_nominal))

    def _credible(self, u: Floats, start: float, rate: float, trial: float) -> CycleFit:
        fit = fit_cycles(u, start, trial, rate, self.cycles, self._dead)
        return fit if self._range[0] - _EDGE <= fit.f <= self._range[1] + _EDGE else NONE

    def _interval(self, chain: _Chain, length: float, fit: CycleFit, stretch: tuple[Floats, int]) -> Interval:
        begin, end = chain.begin, chain.begin + length
        x, low = stretch
        if low + x.shape[1] < end + self._margin:  # f is below the range
            x, low = self._run.physical(begin - self._margin, end + self._margin)
        x = x[:, : int(np.ceil(end + self._margin)) - low]
        flags = self._run.flags(begin, end)
        misled = not chain.trailing and self._sideband.moves(fit, follows=not chain.fresh)
        if misled or fit.jump or fit.beats or not fit.credible:
            flags |= {"transient"}
        elif not chain.trailing and self._sideband.unsettled:
            flags |= {"unsettled"}
        if chain.fresh and self._gap:
            flags |= {"gap"}
        return Interval(
            x=x,
            start=begin - low,
            length=length,
            rate=self._form.rate,
            cycles=self.cycles,
            utc_ns=self._run.utc_ns(begin),
            fit=fit,
            f=self._f,
            flags=flags,
            stops=self._stops,
            first_of_chain=chain.fresh,
            trailing=chain.trailing,
        )

    def _advance(self, chain: _Chain, interval: Interval) -> None:
        """To the next interval of the chain, or of a new one at a tick."""
        begin, end = chain.begin, chain.begin + interval.length
        chain.begin, chain.fresh = end, False
        chain.count = (chain.count + 1) % FIFTEEN
        self._gap = False
        if chain.trailing:
            if chain.count == 0:
                self._chains.remove(chain)
            return
        tick = self._run.position((tick_number(self._run.utc_ns(begin)) + 1) * TICK_NS)
        if tick <= end:
            chain.trailing = True
            self._chains = [_Chain(tick)] if chain.count == 0 else [chain, _Chain(tick)]


def _from(stretch: tuple[Floats, int], position: float) -> tuple[Floats, int]:
    """The samples of a stretch from the cell of `position` on, and the position of the first one."""
    x, low = stretch
    skipped = max(int(position) - low, 0)
    return x[:, skipped:], low + skipped


def tick_number(utc_ns: int) -> int:
    """Number of the ten minutes that an interval with this begin is of; less than 1 ms before a tick is at the tick."""
    return (utc_ns + _AT_TICK_NS) // TICK_NS


def threshold(form: StreamFormat, share: float, nominal_voltage: float) -> Floats:
    """V of each phase below which there is no voltage: a share of nominal, at least four digits of the converter."""
    digits = 4.0 * np.asarray(form.scale)[0::2] if form.bits < 64 else np.zeros(form.phases)
    return np.asarray(np.maximum(share * nominal_voltage, digits))
