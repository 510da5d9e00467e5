"""Electrical losses between mains and motor that change."""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from acqd.arrays import Floats
from acqd.lab.plant.situation import Effect, Situation


class CopperLoss(Effect):
    """Windings that are warmer, or thinner, than they were."""

    id = "copper_loss"
    summary = "winding resistance rises by a share"
    strength = ("relative", "of the present resistance")
    defaults: ClassVar = {"relative": 0.6}
    limits: ClassVar = {"relative": (-0.9, 100)}

    def dc_load(self, situation: Situation) -> Floats:
        """W."""
        resistance = np.array([joint.drive.resistance_Ohm for joint in situation.arm.description.joint])
        loss = (situation.current**2 * resistance).sum(axis=1)
        return np.asarray(self["relative"] * loss * self.gate(situation))


class RegenerationClipping(Effect):
    """What the drives give back together no longer helps the other loads: a brake resistor burns it."""

    id = "regeneration_clipping"
    summary = "a share of the power that the drives give back, beyond above_W, is burnt in a brake resistor"
    strength = ("share", "of the power given back")
    defaults: ClassVar = {"share": 1.0, "above_W": 0.0}
    limits: ClassVar = {"share": (0, 1), "above_W": (0, 1e5)}

    def dc_load(self, situation: Situation) -> Floats:
        """W."""
        given_back = np.maximum(-situation.joint_power.sum(axis=1) - self["above_W"], 0.0)
        return np.asarray(self["share"] * given_back * self.gate(situation))


class SupplyEfficiency(Effect):
    """An ageing power supply: losses that grow with the square of the load."""

    id = "supply_efficiency"
    summary = "extra loss of the supply, in proportion to the square of its load"
    strength = ("loss_at_100W", "W")
    defaults: ClassVar = {"loss_at_100W": 9.0}

    def mains_load(self, situation: Situation) -> Floats:
        """W."""
        return self["loss_at_100W"] * (situation.dc_power / 100.0) ** 2 * self.gate(situation)


class LineVoltage(Effect):
    """Power that follows the mains voltage: a linear supply or a heater among the loads."""

    id = "line_voltage"
    summary = "power depends on the mains voltage by this exponent"
    strength = ("exponent", "of V / nominal V")
    defaults: ClassVar = {"exponent": 1.5}
    limits: ClassVar = {"exponent": (-5, 5)}

    def mains_load(self, situation: Situation) -> Floats:
        """W."""
        ratio = (situation.voltage / situation.nominal_V) ** self["exponent"]
        return situation.mains_power * (ratio - 1.0) * self.gate(situation)
