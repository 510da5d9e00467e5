"""Torque ripple of a gear."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from acqd.arrays import Floats
from acqd.models.effects.cause import Cause
from acqd.models.effects.effect import Effect
from acqd.models.effects.limits import Limits
from acqd.models.effects.places import Parameter, Place, Shape
from acqd.models.effects.scene import Scene
from acqd.models.greybox.model import GreyBox


class GearRipple(Effect):
    """Torque that is periodic in the angle of one joint; the residual determines the joint and the period."""

    id = "gear_ripple"
    cause = Cause.DRIVES
    summary = "torque that comes and goes with the angle of one joint: an eccentric wave generator, a worn tooth"
    equation = "tau = A sin(n q) + B cos(n q)"
    neighbours = ("gravity_bias",)
    experiment = "slow constant-speed turns of the joint over its whole range"
    acts_on = "torque"
    structural = False
    detected = "ripple"
    c_body = """
    lanes_t sine, cosine;
    lanes_sincos(periods_per_turn * p->q[joint], &sine, &cosine);
    torque[joint] = c[0] * sine + c[1] * cosine;
    """

    def at(self, scene: Scene, shape: Shape) -> Floats:
        """[N, 2] W/Nm: sine and cosine at `joint` (from 1) with `periods_per_turn`; no columns without a shape."""
        if not shape:
            return np.zeros((len(scene.q), 0))
        joint = int(shape["joint"]) - 1
        angle, slope = shape["periods_per_turn"] * scene.q[:, joint], scene.power_per_torque[:, joint]
        return np.column_stack([slope * np.sin(angle), slope * np.cos(angle)])

    def places(self, scene: Scene) -> Iterator[Place]:
        """No places before detection."""
        return iter(())

    def detected_place(self, shape: Shape, model: GreyBox) -> Place:
        """The joint of the ripple."""
        most = Limits.of(model).ripple(int(shape["joint"]) - 1)
        both = tuple(Parameter(name, "Nm", -most, most) for name in ("sine", "cosine"))
        return Place(f"joint {int(shape['joint'])}", (0, 1), both)

    def c_constants(self, carrier: GreyBox, shape: Shape) -> dict[str, float | Floats]:
        """Joint (from 0) and periods per turn."""
        return {"joint": int(shape["joint"]) - 1, "periods_per_turn": float(shape["periods_per_turn"])}
