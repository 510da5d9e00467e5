"""A payload at the flange."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import ClassVar

import numpy as np

from acqd.arrays import Floats
from acqd.models.effects.bodies import (
    first_moment_power,
    first_moment_torques,
    first_moments,
    point_mass,
    point_mass_power,
    point_mass_torque,
)
from acqd.models.effects.cause import Cause
from acqd.models.effects.effect import Effect
from acqd.models.effects.limits import Limits
from acqd.models.effects.places import Parameter, Place, Shape
from acqd.models.effects.scene import Scene
from acqd.models.greybox.model import GreyBox

_SHARE_OF_ARM, _BESIDE_M = 0.15, 0.2
"""Prior deviations: mass as a share of the arm's (half the rated payload of most arms), place beside the axis."""
_ON_AXIS_M = 0.005


class Payload(Effect):
    """A body at the flange: always, on or beside the flange's axis, or while the tool is on."""

    id = "payload"
    cause = Cause.LOAD
    summary = "the arm carries a mass that the model does not know"
    equation = "tau = m Y(q, qd, qdd; centre of mass)"
    neighbours = ("gravity_bias", "copper_loss")
    experiment = "the same motion with the gripper empty and with a known mass, tool vertical and horizontal"
    acts_on = "torque"
    at_link = True
    known_mass = True
    shapes = ({"centre_of_mass_m": 0.0}, {"centre_of_mass_m": 0.06}, {"centre_of_mass_m": 0.15})
    bounds: ClassVar = {"centre_of_mass_m": (-0.1, 0.4)}
    c_body = """
    const lanes_t mass = c[0] + c[1] * p->tool;
    last_link_torque_lanes(&p->posture, body, torque);
    for (int k = 0; k < AXES; k++)
        torque[k] *= mass;
    for (int side = 0; side < 2; side++) {
        lanes_t moment[AXES];
        if (c[2 + side] == 0.0)
            continue;
        last_link_torque_lanes(&p->posture, first_moment[side], moment);
        for (int k = 0; k < AXES; k++)
            torque[k] += c[2 + side] * moment[k];
    }
    """

    def at(self, scene: Scene, shape: Shape) -> Floats:
        """[N, 4] W/kg always and while the tool is on (0 without a tool signal), 2 W/(kg m) beside the axis."""
        return self.some(scene, shape, slice(None))

    def some(self, scene: Scene, shape: Shape, columns: Sequence[int] | slice) -> Floats:
        """Without the first moments where no column beside the axis is asked for."""
        chosen = list(range(4)[columns] if isinstance(columns, slice) else columns)
        power = np.zeros((len(scene.q), 4))
        if {0, 1} & set(chosen):
            power[:, 0] = point_mass_power(scene, shape["centre_of_mass_m"])
            power[:, 1] = power[:, 0] * scene.signals.get("tool", 0.0)
        if {2, 3} & set(chosen):
            power[:, 2:] = first_moment_power(scene, shape["centre_of_mass_m"])
        return power[:, chosen]

    def torque(self, scene: Scene, shape: Shape, columns: Sequence[int], coefficients: Floats) -> Floats:
        """From the bodies' torques."""
        always, tool, x, y = (float(coefficients[np.array(columns) == k].sum()) for k in range(4))
        reach_m = shape["centre_of_mass_m"]
        mass = always + tool * scene.signals["tool"][:, None] if tool else always
        torque = mass * point_mass_torque(scene, reach_m)
        return torque + np.tensordot([x, y], first_moment_torques(scene, reach_m), 1) if x or y else torque

    def places(self, scene: Scene) -> Iterator[Place]:
        """The flange: on its axis, beside its axis, or on its axis with the tool."""
        limits = Limits.of(scene.model)
        usual_kg = _SHARE_OF_ARM * limits.arm_kg
        mass = Parameter("mass", "kg", -limits.arm_kg, limits.payload_kg, usual_kg)
        most = limits.moment_kg_m
        moments = tuple(Parameter(f"first moment {side}", "kg m", -most, most, usual_kg * _BESIDE_M) for side in "xy")
        yield Place("flange", (0,), (mass,))
        yield Place("flange, beside its axis", (0, 2, 3), (mass, *moments))
        if "tool" in scene.signals:
            yield Place("flange, while the tool is on", (1,), (mass,))

    def lever(self, model: GreyBox, place: Place, shape: Shape) -> float | None:
        """None where the mass is on the last axis, or beside the flange's."""
        point = model.chain.beyond_flange(shape["centre_of_mass_m"])
        axis = model.chain.axis[-1] / np.linalg.norm(model.chain.axis[-1])
        lever_m = float(np.linalg.norm(point - (point @ axis) * axis))
        slides = model.layout.axes - 1 in model.layout.sliding
        return None if slides or len(place.columns) > 1 or lever_m < _ON_AXIS_M else lever_m

    def c_constants(self, carrier: GreyBox, shape: Shape) -> dict[str, float | Floats]:
        """Inertial parameters [10] of 1 kg, and [2, 10] of 1 kg m beside the axis."""
        reach_m = shape["centre_of_mass_m"]
        return {
            "body": point_mass(carrier.chain.beyond_flange(reach_m)),
            "first_moment": first_moments(carrier.chain, reach_m),
        }

    def signals_of(self, columns: Sequence[int]) -> set[str]:
        """The tool, for the mass that comes and goes with the tool."""
        return {"tool"} if 1 in columns else set()
