"""Laws without a name, which no effect of the library holds: flexible functions that can correct a model.

They compete with the effects. Where one of them explains most, the cause is unknown, and the law is its description.
The torque of a law is a spring, a worn tooth, friction of another curve, a coupling of two axes or backlash; its power
is torque times the power per torque, so that it competes with the torques of named effects.
"""

from __future__ import annotations

from functools import cache

from acqd.models.effects.laws.friction_laws import AngleFriction, CoupledFriction, CurvedFriction, LoadFriction
from acqd.models.effects.laws.law import Law
from acqd.models.effects.laws.power_laws import PowerAboveLevels, PowerOfAngle, PowerOfMoving, PowerOfSpeed
from acqd.models.effects.laws.torque_laws import AngleTorque, Hysteresis, ReflectedInertia

TORQUE_LAWS: tuple[Law, ...] = (
    AngleTorque(), AngleFriction(), LoadFriction(), CoupledFriction(), CurvedFriction(), Hysteresis(),
)  # fmt: skip
"""Of one joint, in the order of their columns."""
POWER_LAWS: tuple[Law, ...] = (
    PowerOfMoving(), PowerOfAngle(), PowerOfSpeed(), ReflectedInertia(), PowerAboveLevels()
)  # fmt: skip
"""The other laws, in the order of their columns."""


@cache
def laws() -> dict[str, Law]:
    """All laws by id."""
    return {law.id: law for law in (*POWER_LAWS, *TORQUE_LAWS)}
