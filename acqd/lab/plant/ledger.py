"""The energy ledger: it checks that the supplied energy equals stored plus dissipated energy of all loss channels."""

from __future__ import annotations

import numpy as np

from acqd.arrays import Floats
from acqd.motion.controller import RATE


class Ledger:
    """Energies (J) of one uninterrupted stream of 1 kHz samples, by the trapezoidal rule."""

    def __init__(self) -> None:
        self._sums: dict[str, float] = {}
        self._first: dict[str, float] = {}
        self._last: dict[str, float] = {}
        self._samples = 0
        self._stored: list[float] = []
        self._payload_energy = 0.0

    def add(self, powers: dict[str, Floats]) -> None:
        """Add the power [T] (W) of each channel; missing channels have zero power."""
        samples = len(next(iter(powers.values())))
        for name, power in powers.items():
            if name not in self._sums:
                self._sums[name] = 0.0
                self._first[name] = float(power[0]) if self._samples == 0 else 0.0
            self._sums[name] += float(power.sum())
        self._last = {name: float(power[-1]) for name, power in powers.items()}
        self._samples += samples

    def stored(self, energy: float) -> None:
        """Record the energy (J) in arm, rotors and capacitors, first at the start of the stream, then later."""
        self._stored.append(energy)

    def add_payload_energy(self, energy: float) -> None:
        """Add energy (J) that payloads bring into the system."""
        self._payload_energy += energy

    def energy(self, channel: str) -> float:
        """Energy (J) of one channel so far."""
        ends = self._first.get(channel, 0.0) + self._last.get(channel, 0.0)
        return (self._sums.get(channel, 0.0) - 0.5 * ends) / RATE

    def balance(self) -> dict[str, object]:
        """Supplied, stored and dissipated energy (J), and the balance error as a share of the supplied energy."""
        channels = {name: self.energy(name) for name in self._sums if name != "supplied"}
        supplied = self.energy("supplied")
        stored = self._stored[-1] - self._stored[0] if self._stored else 0.0
        error = supplied + self._payload_energy - stored - sum(channels.values())
        return {
            "supplied_J": supplied,
            "stored_J": stored,
            "brought_in_by_payloads_J": self._payload_energy,
            "dissipated_J": channels,
            "unaccounted_share": abs(error) / max(abs(supplied), 1e-9),
            "seconds": self._samples / RATE,
        }


def row_sum(power: Floats) -> Floats:
    """Power [T, axes] summed over the axes, [T]."""
    return np.asarray(power.sum(axis=1))
