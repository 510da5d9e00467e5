"""Where the energy went: supplied = stored + dissipated per loss channel, checked, not assumed."""

from __future__ import annotations

import numpy as np

from acqd.arrays import Floats
from acqd.lab.motion.controller import RATE


class Ledger:
    """Energies (J) by the trapezoidal rule over one uninterrupted stream of 1 kHz samples."""

    def __init__(self) -> None:
        self._sums: dict[str, float] = {}
        self._first: dict[str, float] = {}
        self._last: dict[str, float] = {}
        self._samples = 0
        self._stored: list[float] = []
        self._brought_in = 0.0

    def add(self, powers: dict[str, Floats]) -> None:
        """Channel -> power [T] (W). A channel that is absent has zero power."""
        samples = len(next(iter(powers.values())))
        for name, power in powers.items():
            if name not in self._sums:
                self._sums[name] = 0.0
                self._first[name] = float(power[0]) if self._samples == 0 else 0.0
            self._sums[name] += float(power.sum())
        self._last = {name: float(power[-1]) for name, power in powers.items()}
        self._samples += samples

    def stored(self, energy: float) -> None:
        """Energy (J) in arm, rotors and capacitors at the stream's begin, then at later samples."""
        self._stored.append(energy)

    def brought_in(self, energy: float) -> None:
        """Energy (J) that came with payloads."""
        self._brought_in += energy

    def energy(self, channel: str) -> float:
        """J."""
        ends = self._first.get(channel, 0.0) + self._last.get(channel, 0.0)
        return (self._sums.get(channel, 0.0) - 0.5 * ends) / RATE

    def balance(self) -> dict[str, object]:
        """Supplied, stored, dissipated per channel (J), and what does not add up as a share of the supplied."""
        channels = {name: self.energy(name) for name in self._sums if name != "supplied"}
        supplied = self.energy("supplied")
        stored = self._stored[-1] - self._stored[0] if self._stored else 0.0
        missing = supplied + self._brought_in - stored - sum(channels.values())
        return {
            "supplied_J": supplied,
            "stored_J": stored,
            "brought_in_by_payloads_J": self._brought_in,
            "dissipated_J": channels,
            "unaccounted_share": abs(missing) / max(abs(supplied), 1e-9),
            "seconds": self._samples / RATE,
        }


def row_sum(power: Floats) -> Floats:
    """Total over axes [T] of power [T, axes]."""
    return np.asarray(power.sum(axis=1))
