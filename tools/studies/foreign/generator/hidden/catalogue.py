"""All hidden effects by name."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from tools.studies.foreign.generator.hidden import electrical, mechanical, outside
from tools.studies.foreign.generator.hidden.effect import Hidden

if TYPE_CHECKING:
    from tools.studies.foreign.generator.plant import Session

Builder: TypeAlias = "Callable[[Session, np.random.Generator], Hidden]"

MECHANICAL: dict[str, Builder] = {
    build.__name__: build
    for build in (
        mechanical.payload, mechanical.gravity_bias, mechanical.coulomb_friction, mechanical.viscous_friction,
        mechanical.stribeck_friction, mechanical.load_dependent_friction, mechanical.mechanical_power,
        mechanical.thermal_friction, mechanical.gear_ripple, mechanical.contact_force,
    )
}  # fmt: skip
ELECTRICAL: dict[str, Builder] = {
    build.__name__: build
    for build in (
        electrical.copper_loss, electrical.supply_efficiency, electrical.regeneration_clipping,
        electrical.offset_shift, electrical.brake_holding, electrical.brake_release, electrical.tool_actuation,
        electrical.process_load, electrical.thermostat, electrical.line_voltage, electrical.meter_gain,
        electrical.meter_saturation, electrical.clock_offset, electrical.clock_drift,
    )
}  # fmt: skip
OUTSIDE: dict[str, Builder] = {
    build.__name__: build
    for build in (
        outside.spring, outside.speed_product, outside.dead_zone, outside.backlash, outside.torque_hysteresis,
        outside.cubic_speed, outside.angle_friction, outside.random_walk, outside.pulsation, outside.lagging_pump,
    )
}  # fmt: skip
ALL = MECHANICAL | ELECTRICAL | OUTSIDE
NEED_SIGNALS = ("brake_holding", "brake_release", "tool_actuation")
"""Effects that exist only where brakes and tool are logged."""
CLOCKS = ("clock_offset", "clock_drift")
