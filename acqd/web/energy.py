"""Energy of today, yesterday and this week for the page, in local time, shared by all viewers."""

from __future__ import annotations

import threading
import time
from typing import Any

import sqlalchemy as sa

from acqd.daemon.energy_section import EnergySection
from acqd.energy.rules import rules_of
from acqd.energy.running import RunningEnergy

_KEPT_S = 60.0
"""An answer is good for so long; all viewers share it."""

_MOST_KEPT = 1_000
"""Devices; strangers may ask for any name."""


class EnergyOfDays:
    """Reads the registers of a device at midnights; with a tariff also what they cost."""

    def __init__(self, section: EnergySection) -> None:
        """Raises UserError for a tariff that cannot be read."""
        self._running = RunningEnergy(rules_of(section), lambda: time.time())
        self._kept: dict[str, tuple[float, dict[str, Any]]] = {}
        self._reading = threading.Lock()  # one at a time: the page must not take the database from the sink

    def of(self, engine: sa.Engine, device: str) -> dict[str, Any]:
        """Energies [kWh], costs [EUR] and prices; None where no row or no price is known."""
        with self._reading:
            at, answer = self._kept.get(device, (0.0, {}))
            if time.monotonic() - at > _KEPT_S or not answer:
                answer = self._running.of(engine, device).as_json()
                if len(self._kept) > _MOST_KEPT:
                    self._kept.clear()
                self._kept[device] = time.monotonic(), answer
            return answer
