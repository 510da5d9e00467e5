"""Positions of the zero crossings of one voltage's fundamental: a phase-locked loop with a step per half cycle.

The phase detector is the Fourier integral of the last whole cycle, in which harmonics and DC vanish: crossings of the
samples themselves move with both, and an interrupted voltage has none. The loop runs on while the voltage is away.
"""

from __future__ import annotations

import cmath
import math

import numpy as np

from acqd.arrays import Floats

PULL = 0.25  # of a phase error is corrected in the next half cycle
STEER = 0.02  # of it changes the frequency for good; critically damped with PULL
JUMP = 0.6  # rad: a jump of the phase rather than a change of f; f is held
LOST = 25  # half cycles with a jump that does not end: lock again
RANGE = 0.2  # share of the nominal frequency in which f is looked for
PURITY = 0.5  # share of the power that the fundamental must have for its phase to count
CALM = 0.02  # change of the amplitude within half a cycle from which on the phase of a cycle means nothing
_LOOKS = 4  # refinements of f when locking


class CycleClock:
    """Half cycles of one channel; positions are sample numbers of the stream, with fractions."""

    def __init__(self, rate: float, f_nominal: float) -> None:
        self.nominal = rate / f_nominal / 2
        """Samples per half cycle at the nominal frequency."""
        self.half = self.nominal
        """Samples per half cycle, as far as known."""
        self.next: float | None = None
        """The next bound of a half cycle; None before the first `lock`."""
        self.astray = 0
        """Half cycles since a jump of the phase."""
        self.amplitude = 0.0
        """Of the last cycle, as its Fourier integral."""

    @property
    def locked(self) -> bool:
        """Whether there is a phase to go on from."""
        return self.next is not None

    def need(self) -> float:
        """Samples that `lock` wants: three cycles."""
        return 6 * self.nominal * (1 + RANGE)

    def most(self, samples: int) -> int:
        """Half cycles that so many samples can complete at most."""
        return int(samples * (1 + RANGE) / (1 - PULL * JUMP / math.pi) / self.nominal) + 2

    def lock(self, u: Floats, origin: int) -> None:
        """Find frequency and phase at the start of `u`, whose first sample is number `origin`."""
        self.half, self.astray = self.nominal, 0
        known = True
        for _ in range(_LOOKS):
            early, late = (self._phasor(u, start) for start in (0.0, 2 * self.half))
            known = abs(early) > 0 and abs(late) > 0
            if not known:
                break
            turn = cmath.phase(late / early)
            self.half = self._within(self.half / (1 + turn / (2 * math.pi)))
        theta = cmath.phase(self._phasor(u, 0.0)) if known else 0.0
        self.next = origin + 2 * self.half + (-theta % math.pi) / math.pi * self.half

    def cycles(
        self, origin: int, integral: np.ndarray, power: Floats, carrier: float, end: int
    ) -> list[tuple[float, float]]:
        """Begin and end of the cycles that end before sample number `end`, one every half cycle.

        Each one is as long as a cycle is; they overlap by half, except while the phase is being followed.

        `integral` [samples + 1]: cumulative sum of u exp(-j `carrier` k), k = 0 at `origin`; `power` the same of u^2.
        """
        assert self.next is not None
        found, next_bound = [], self.next
        while next_bound < end:
            found.append((next_bound - 2 * self.half, next_bound))
            next_bound += self._step(next_bound, origin, integral, power, carrier)
        self.next = next_bound
        return found

    def _step(self, bound: float, origin: int, integral: np.ndarray, power: Floats, carrier: float) -> float:
        """Samples from `bound` to the next one."""
        first, last = bound - 2 * self.half - origin, bound - origin
        if first < 0:
            return self.half
        z = _at(integral, last) - _at(integral, first)
        squares = (_at(power, last) - _at(power, first)).real
        amplitude, before = abs(z), self.amplitude
        self.amplitude = amplitude
        pure = squares > 0 and 2 * amplitude**2 >= PURITY * squares * (last - first)
        if not (pure and abs(amplitude - before) <= CALM * max(amplitude, before)):  # also of samples that are NaN
            return self.half
        # Of a sine that crosses zero at `bound`: a quarter turn back for the sine, half a turn to the cycle's end.
        theta = cmath.phase(z) + carrier * (last - self.half) + 1.5 * math.pi
        error = (theta + math.pi / 2) % math.pi - math.pi / 2
        if abs(error) > JUMP:
            self.astray += 1
            if self.astray > LOST:
                self.astray, self.half = 0, self.nominal
        else:
            self.astray = 0
            self.half = self._within(self.half * (1 - STEER * error / math.pi))
        return self.half * (1 - PULL * error / math.pi)

    def _phasor(self, u: Floats, start: float) -> complex:
        """Fourier integral of the two cycles from `start` on, Hann tapered; the phase is a sine's at the middle."""
        first, count = round(start), round(4 * self.half)
        k = np.arange(count)
        middle = (count - 1) / 2
        carrier = np.exp(-1j * math.pi / self.half * (k - middle + first - start))
        return complex(1j * (u[first : first + count] * np.hanning(count + 2)[1:-1] @ carrier))

    def _within(self, half: float) -> float:
        return min(max(half, self.nominal / (1 + RANGE)), self.nominal * (1 + RANGE))


def _at(cumulative: np.ndarray, position: float) -> complex:
    """A cumulative sum between two samples."""
    k = int(position)
    here = cumulative.item(k)
    return complex(here + (position - k) * (cumulative.item(k + 1) - here))
