"""Process equipment."""

from __future__ import annotations

from acqd.models.effects.cause import Cause
from acqd.models.effects.switching_load import SwitchingLoad


class ProcessLoad(SwitchingLoad):
    """Equipment that works for some seconds at irregular times."""

    id = "process_load"
    cause = Cause.OTHER
    summary = "equipment on the same supply that works for some seconds at a time"
    equation = "P = P_e while it works"
    neighbours = ("thermostat", "contact_force", "tool_actuation")
    experiment = "log when the equipment works, or record an hour with it switched off"
    detected = "bursts"
