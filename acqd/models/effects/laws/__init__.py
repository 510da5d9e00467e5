"""Laws without a name, which no effect of the library holds: flexible functions that can correct a model.

They compete with the effects. Where one of them explains most, the cause is unknown, and the law is its description.
"""

from __future__ import annotations

from functools import cache

from acqd.models.effects.laws.law import Law
from acqd.models.effects.laws.power_laws import PowerAboveLevels, PowerOfAngle, PowerOfMoving, PowerOfSpeed
from acqd.models.effects.laws.torque_laws import (
    AngleFriction,
    AngleTorque,
    CoupledFriction,
    CurvedFriction,
    Hysteresis,
    LoadFriction,
    ReflectedInertia,
)


@cache
def laws() -> dict[str, Law]:
    """All laws by id."""
    everything: list[Law] = [
        PowerOfMoving(), PowerOfAngle(), PowerOfSpeed(), ReflectedInertia(), PowerAboveLevels(), AngleTorque(),
        AngleFriction(), LoadFriction(), CoupledFriction(), CurvedFriction(), Hysteresis(),
    ]  # fmt: skip
    return {law.id: law for law in everything}
