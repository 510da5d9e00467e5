"""Loads beside the drives."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from acqd.arrays import Floats
from acqd.models.effects.effect import Effect, Parameter, Place, Shape
from acqd.models.effects.scene import Scene


class OffsetShift(Effect):
    """A constant load more, or less."""

    id = "offset_shift"
    summary = "something takes a constant power more (or less): another device on the same supply"
    equation = "P = P_0"
    neighbours = ("meter_gain", "thermostat", "brake_holding")
    experiment = "two minutes at rest before and after"
    structural = False

    def at(self, scene: Scene, shape: Shape) -> Floats:
        """One."""
        return np.ones((len(scene.q), 1))

    def places(self, scene: Scene) -> Iterator[Place]:
        """One."""
        yield Place("cabinet", (0,), (Parameter("power", "W"),))


class _Switching(Effect):
    """A load that is on or off; only the residual tells when."""

    predictable = False
    structural = False

    def at(self, scene: Scene, shape: Shape) -> Floats:
        """Its mean, once the residual has told how long it is on; when exactly, nobody can foresee."""
        if not shape:
            return np.zeros((len(scene.q), 0))
        return np.full((len(scene.q), 1), shape["share_of_time"])

    def places(self, scene: Scene) -> Iterator[Place]:
        """None beforehand: `switching.search` looks for on and off in the residual."""
        return iter(())


class Thermostat(_Switching):
    """A load that switches with a period of its own."""

    id = "thermostat"
    summary = "a fan or heater that switches on and off in a rhythm of its own"
    equation = "P = P_h while on"
    neighbours = ("offset_shift", "process_load")
    experiment = "an hour at rest"


class ProcessLoad(_Switching):
    """Equipment that works now and then."""

    id = "process_load"
    summary = "equipment on the same supply that works for some seconds at a time"
    equation = "P = P_e while it works"
    neighbours = ("thermostat", "contact_force", "tool_actuation")
    experiment = "log when the equipment works, or record an hour with it switched off"
