"""Three effects that no library of ours knows, so that "unknown" is the only right answer."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from scipy.signal import lfilter

from acqd.arrays import Floats
from acqd.lab.effects.registry import known_effects
from acqd.lab.plant.situation import Effect, Situation
from acqd.motion.controller import RATE


class SpeedBand(Effect):
    """A resonance: an axis takes more power within a band of speeds, none outside of it."""

    id = "outside_speed_band"
    summary = "extra power while one axis is within a band of speeds"
    strength = ("power_W", "W")
    defaults: ClassVar = {"power_W": 20.0, "axis": 2.0, "speed_rad_s": 0.45, "width_rad_s": 0.08}

    def dc_load(self, situation: Situation) -> Floats:
        """Power of the resonance [W]."""
        speed = np.abs(situation.motion.qd[:, int(self["axis"]) - 1])
        bump = np.exp(-(((speed - self["speed_rad_s"]) / self["width_rad_s"]) ** 2))
        return self["power_W"] * bump * self.gate(situation)


class LaggingFan(Effect):
    """A fan that follows the drives' power half a minute late."""

    id = "outside_lagging_fan"
    summary = "extra power in proportion to the drives' power, averaged over the last seconds"
    strength = ("share", "of the drives' power")
    defaults: ClassVar = {"share": 0.3, "tau_s": 12.0}

    def begin(self) -> None:
        """At rest."""
        self._level = 0.0

    def dc_load(self, situation: Situation) -> Floats:
        """Power of the fan [W]."""
        keep = np.exp(-1 / (RATE * self["tau_s"]))
        power = np.abs(situation.joint_power.sum(axis=1))
        level, _ = lfilter([1 - keep], [1, -keep], power, zi=[keep * self._level])
        self._level = float(level[-1])
        return np.asarray(self["share"] * level * self.gate(situation))


class Zone(Effect):
    """A heater or light that is on while an axis stands in a zone, whatever the arm does."""

    id = "outside_zone"
    summary = "extra power while one axis' angle lies within a zone"
    strength = ("power_W", "W")
    defaults: ClassVar = {"power_W": 10.0, "axis": 1.0, "middle_rad": 0.3, "half_rad": 0.5}

    def mains_load(self, situation: Situation) -> Floats:
        """Power within the range of angles [W]."""
        off = np.abs(situation.motion.q[:, int(self["axis"]) - 1] - self["middle_rad"])
        return self["power_W"] * (off < self["half_rad"]) * self.gate(situation)


OUTSIDE: tuple[type[Effect], ...] = (SpeedBand, LaggingFan, Zone)


def register() -> None:
    """Make them known to the laboratory, as an installed package's entry points would."""
    known_effects().update({cls.id: cls for cls in OUTSIDE})
