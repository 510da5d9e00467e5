"""A load that swings in time like a sine: a pump, a heater that pulses within seconds, a fan out of balance.

No effect of the library draws such power, and no path of on and off follows a sine. Not searched for, what a sine
explains would go to whatever switches or touches at the same moments.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from acqd.arrays import Floats
from acqd.discrepancy.thresholds import THRESHOLDS
from acqd.residual.whitening import Whitener

_FINER = 4
"""Frequencies that are compared within the resolution of the longest segment."""


@dataclass(frozen=True, slots=True)
class Wave:
    """A sine of one frequency, whose phase differs from segment to segment: no load keeps time over pauses."""

    turn: float
    """Phase in rad from row to row."""
    phases: Floats
    """[segments] rad at the first row."""
    tried: int
    """Frequencies that can be told from each other."""
    gain: float
    """Log-likelihood ratio against no load, with an amplitude for every segment."""

    @property
    def rows(self) -> float:
        """Rows of a period."""
        return 2 * np.pi / self.turn

    def columns(self, lengths: list[int]) -> list[Floats]:
        """[T, 1] per segment of so many rows: the sine with an amplitude of 1."""
        return [
            np.cos(self.turn * np.arange(length) + phase)[:, None]
            for length, phase in zip(lengths, self.phases, strict=True)
        ]


def search(residuals: list[Floats], whitener: Whitener) -> Wave | None:
    """The sine that explains most of residuals [T] W per segment; None in segments too short for the slowest.

    White rows of a sine are a sine, whatever the whitener's gain is there: the periodogram of white rows is the
    log-likelihood ratio of the best sine of every frequency (Schuster 1898). A fraction of a period is a curve like any
    other: the slowest sine has as many periods as the slowest ripple.
    """
    white = [whitener.apply(each) for each in residuals]
    longest = max((len(each) for each in white), default=0)
    bins = int(2 ** np.ceil(np.log2(max(_FINER * longest, 2))))
    shortest = min((len(each) for each in white if len(each) > longest / 2), default=0)
    slowest = int(np.ceil(THRESHOLDS.ripple_fewest_periods * bins / max(shortest, 1)))
    if slowest >= bins // 2:
        return None
    spectra = [np.fft.rfft(each, bins) for each in white]
    power = np.zeros(bins // 2 + 1)
    for spectrum, rows in zip(spectra, white, strict=True):
        power += np.abs(spectrum) ** 2 / max(len(rows), 1)
    at = slowest + int(np.argmax(power[slowest:-1]))
    turn = 2 * np.pi * at / bins
    order = len(whitener.taps) - 1
    response = np.exp(-1j * turn * np.arange(order + 1)) @ whitener.taps
    shift = np.angle(response) + turn * order  # white rows begin `order` rows later
    phases = np.array([np.angle(each[at]) for each in spectra]) - shift
    tried = max(1, round((bins // 2 - slowest) * longest / bins))
    return Wave(turn, phases, tried, float(power[at]))
