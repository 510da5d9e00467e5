"""Electrical losses between mains and motor, and the supply."""

from __future__ import annotations

from collections.abc import Iterator
from typing import ClassVar

import numpy as np

from acqd.arrays import Floats
from acqd.models.effects.effect import Effect, Parameter, Place, Shape, per_joint
from acqd.models.effects.scene import Scene


class CopperLoss(Effect):
    """Loss in the windings."""

    id = "copper_loss"
    summary = "the motors' windings lose more (or less) power than the model has it: warmer, or damaged"
    equation = "P = R sum(c tau^2)"
    neighbours = ("payload", "viscous_friction", "supply_efficiency")
    experiment = "hold the arm stretched out for a minute, with and without a payload"

    def at(self, scene: Scene, shape: Shape) -> Floats:
        """Per joint."""
        return scene.tau**2

    def places(self, scene: Scene) -> Iterator[Place]:
        """Places."""
        yield from per_joint(scene.axes, "loss", "W/Nm^2", np.maximum(scene.model.group("copper"), 0.0))


class RegenerationClipping(Effect):
    """Power that drives give back is burnt."""

    id = "regeneration_clipping"
    summary = "power that the drives give back while braking is burnt instead of used"
    equation = "P = s max(-P_drives - P_0, 0)"
    neighbours = ("supply_efficiency", "mechanical_power")
    experiment = "lower a heavy payload fast, again and again"
    shapes = ({"above_W": 0.0}, {"above_W": 10.0}, {"above_W": 25.0}, {"above_W": 50.0})
    bounds: ClassVar = {"above_W": (0.0, 200.0)}

    def at(self, scene: Scene, shape: Shape) -> Floats:
        """One."""
        return np.maximum(-scene.drives - shape["above_W"], 0.0)[:, None]

    def places(self, scene: Scene) -> Iterator[Place]:
        """One."""
        yield Place("DC link", (0,), (Parameter("share", "-", 0.0, 1.5),))


class SupplyEfficiency(Effect):
    """Losses of the supply that grow with the square of its load."""

    id = "supply_efficiency"
    summary = "the power supply loses more the harder it works"
    equation = "P = a (P_load / 100 W)^2"
    neighbours = ("meter_gain", "copper_loss")
    experiment = "rest, a slow motion and a fast one, each for a minute: the loss grows with the square"
    shapes = tuple({"standby_elsewhere": share} for share in (0.0, 0.5, 0.8, 1.0))
    bounds: ClassVar = {"standby_elsewhere": (0.0, 1.0)}

    def at(self, scene: Scene, shape: Shape) -> Floats:
        """The square of what is on this supply: a share of the standby power is not."""
        standby = float(scene.model.group("standby")[0])
        load = np.maximum(scene.drives + standby * (1 - shape["standby_elsewhere"]), 0.0)
        return ((load / 100) ** 2)[:, None]

    def places(self, scene: Scene) -> Iterator[Place]:
        """One."""
        yield Place("supply", (0,), (Parameter("loss at 100 W", "W"),))


class LineVoltage(Effect):
    """Power that follows the mains voltage."""

    id = "line_voltage"
    summary = "power follows the mains voltage: a linear supply or a heater among the loads"
    equation = "P = k P_model (V / V_n - 1)"
    neighbours = ("meter_gain", "offset_shift")
    experiment = "record an hour at rest with the mains voltage"
    needs = ("Vrms",)
    stage = "meter"

    def at(self, scene: Scene, shape: Shape) -> Floats:
        """Of everything, and of a constant load."""
        assert scene.volts is not None
        nominal = 230.0 if 180 < float(np.nanmedian(scene.volts)) < 260 else float(np.nanmedian(scene.volts))
        off = np.nan_to_num(scene.volts / nominal - 1)
        return np.column_stack([off * scene.predicted, off])

    def places(self, scene: Scene) -> Iterator[Place]:
        """Both."""
        yield Place("all loads", (0,), (Parameter("exponent", "-"),))
        yield Place("a constant load", (1,), (Parameter("power per relative voltage", "W"),))
