"""Transients of the voltage, by its waveform: samples that differ from those of one and of two cycles before.

The smaller one of both differences counts, so that the echo of a transient, one and two cycles later, is none. What
lasts for half a cycle or longer is no transient but a change of the voltage - a dip, a swell, a jump of the phase:
excursions less than `_APART` of a cycle apart are one, and such a change shows twice in its first cycle. Periodic
notches are in the cycles before, too, and do not count.

IEC 61000-4-30 has no definition of class A (its annex on transients is informative); impulsive and oscillatory are
those of IEEE 1159: of one polarity, or ringing.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from acqd.arrays import Floats
from acqd.metering.block import SampleBlock, StreamFormat

_APART = 0.6
"""Cycles without an excursion after which it is over."""
_LONGEST = 0.5
"""Cycles; what lasts longer is a change of the voltage."""
_RINGS = 3
"""Changes of polarity that make a transient an oscillatory one."""


@dataclass(slots=True)
class Transient:
    """One transient."""

    begin: float
    """Sample number of its first sample."""
    end: float
    """After its last sample."""
    extreme: float
    """V: largest distance from the undisturbed waveform."""
    phases: set[int] = field(default_factory=set)
    polarities: dict[int, int] = field(default_factory=dict)
    """Of the last excursion of each phase."""
    changes: dict[int, int] = field(default_factory=dict)
    """Changes of polarity of each phase."""

    @property
    def oscillatory(self) -> bool:
        """Whether it rings."""
        return max(self.changes.values(), default=0) >= _RINGS


class TransientDetector:
    """Watches the voltages of one stream."""

    def __init__(self, form: StreamFormat, threshold: float) -> None:
        """`threshold`: share of the peak of the reference voltage."""
        self._threshold = threshold * np.sqrt(2)
        self._scale = np.asarray(form.scale[0::2])
        self._longest = 1.2 * form.rate / form.f_nominal  # samples of a cycle at most
        self._restart()

    def _restart(self) -> None:
        self._u: Floats = np.empty((len(self._scale), 0))
        self._origin = self._done = 0
        self._open: Transient | None = None

    def feed(self, block: SampleBlock, reference: float, cycle: float) -> Iterator[Transient]:
        """Transients that are over with `block`; `reference` [V], `cycle`: samples of a cycle. A gap begins anew."""
        if block.index != self._origin + self._u.shape[1]:
            self._restart()
            self._origin = self._done = block.index
        self._u = np.concatenate((self._u, block.codes[:, 0::2].T * self._scale[:, None]), axis=1)
        end = self._origin + self._u.shape[1]
        first = max(self._done, self._origin + int(2 * cycle) + 2)
        if first < end and cycle <= self._longest:
            off = self._differences(np.arange(first, end) - self._origin, cycle)
            beyond = np.abs(off) > self._threshold * reference
            for at in np.flatnonzero(beyond.any(axis=0)).tolist():
                yield from self._over(first + at, cycle)
                self._note(first + at, off[:, at], beyond[:, at])
            yield from self._over(end, cycle)
        self._done = end
        spare = self._u.shape[1] - int(2 * self._longest) - 4
        if spare > 0:
            self._u, self._origin = self._u[:, spare:], self._origin + spare

    def _differences(self, at: np.ndarray, cycle: float) -> Floats:
        """[phases, samples] V: of one or two cycles before, whichever is smaller."""
        now = self._u[:, at]
        one, two = now - self._before(at, cycle), now - self._before(at, 2 * cycle)
        return np.asarray(np.where(np.abs(one) < np.abs(two), one, two))

    def _before(self, at: np.ndarray, samples: float) -> Floats:
        """The voltages so many samples earlier, linear in between."""
        whole = int(np.ceil(samples))
        share = whole - samples
        return np.asarray((1 - share) * self._u[:, at - whole] + share * self._u[:, at - whole + 1])

    def _note(self, number: int, off: Floats, beyond: np.ndarray) -> None:
        one = self._open
        if one is None:
            one = self._open = Transient(number, number, 0.0)
        one.end = number + 1
        one.extreme = max(one.extreme, float(np.abs(off).max()))
        for phase in np.flatnonzero(beyond).tolist():
            polarity = 1 if off[phase] > 0 else -1
            if one.polarities.get(phase, polarity) != polarity:
                one.changes[phase] = one.changes.get(phase, 0) + 1
            one.polarities[phase] = polarity
            one.phases.add(phase)

    def _over(self, number: float, cycle: float) -> Iterator[Transient]:
        """The excursion in progress, if it is over before sample `number` and was a transient."""
        one = self._open
        if one is None or number - one.end < _APART * cycle:
            return
        self._open = None
        if one.end - one.begin < _LONGEST * cycle:
            yield one
