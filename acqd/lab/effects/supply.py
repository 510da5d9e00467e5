"""Changed electrical losses between the mains and the motors."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from acqd.arrays import Floats
from acqd.lab.plant.situation import Effect, Situation


class CopperLoss(Effect):
    """Winding resistance rises, for example because the motors are warmer."""

    id = "copper_loss"
    summary = "winding resistance rises by a share"
    strength = ("relative", "of the present resistance")
    defaults: ClassVar = {"relative": 0.6}
    limits: ClassVar = {"relative": (-0.9, 100)}

    def dc_load(self, situation: Situation) -> Floats:
        """Additional copper loss I^2 R, [T] W."""
        resistance = np.array([joint.drive.resistance_Ohm for joint in situation.arm.description.joint])
        loss = (situation.current**2 * resistance).sum(axis=1)
        return np.asarray(self["relative"] * loss * self.gate(situation))


class RegenerationClipping(Effect):
    """Regenerated power no longer feeds the other loads: a brake resistor dissipates it."""

    id = "regeneration_clipping"
    summary = "a share of the regenerated power of all drives beyond above_W is dissipated in a brake resistor"
    strength = ("share", "of the regenerated power")
    defaults: ClassVar = {"share": 1.0, "above_W": 0.0}
    limits: ClassVar = {"share": (0, 1), "above_W": (0, 1e5)}

    def dc_load(self, situation: Situation) -> Floats:
        """Power of the brake resistor, [T] W."""
        regenerated = np.maximum(-situation.joint_power.sum(axis=1) - self["above_W"], 0.0)
        return np.asarray(self["share"] * regenerated * self.gate(situation))


class SupplyEfficiency(Effect):
    """An ageing power supply: losses that grow with the square of the load."""

    id = "supply_efficiency"
    summary = "extra loss of the power supply, proportional to the square of its load"
    strength = ("loss_at_100W", "W")
    defaults: ClassVar = {"loss_at_100W": 9.0}

    def mains_load(self, situation: Situation) -> Floats:
        """Additional loss of the supply, [T] W."""
        return self["loss_at_100W"] * (situation.dc_power / 100.0) ** 2 * self.gate(situation)


class LineVoltage(Effect):
    """Power that depends on the mains voltage: a linear supply or a heater among the loads."""

    id = "line_voltage"
    summary = "power depends on the mains voltage with this exponent"
    strength = ("exponent", "of V / nominal V")
    defaults: ClassVar = {"exponent": 1.5}
    limits: ClassVar = {"exponent": (-5, 5)}

    def mains_load(self, situation: Situation) -> Floats:
        """Change of power with the voltage, [T] W."""
        ratio = (situation.voltage / situation.nominal_V) ** self["exponent"]
        return situation.mains_power * (ratio - 1.0) * self.gate(situation)
