"""A load with a rhythm."""

from __future__ import annotations

from acqd.models.effects.cause import Cause
from acqd.models.effects.switching_load import SwitchingLoad


class Thermostat(SwitchingLoad):
    """A load that switches periodically."""

    id = "thermostat"
    cause = Cause.OTHER
    summary = "a fan or heater that switches on and off periodically"
    equation = "P = P_h while on"
    neighbours = ("offset_shift", "process_load")
    experiment = "an hour at rest"
    detected = "rhythm"
