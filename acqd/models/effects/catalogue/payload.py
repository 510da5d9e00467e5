"""A payload at the flange."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import ClassVar

import numpy as np

from acqd.arrays import Floats
from acqd.models.effects.bodies import point_mass, point_mass_power
from acqd.models.effects.effect import Effect
from acqd.models.effects.places import Parameter, Place, Shape
from acqd.models.effects.scene import Scene
from acqd.models.greybox.model import GreyBox


class Payload(Effect):
    """A mass on the flange's axis: always, or while the tool is on."""

    id = "payload"
    summary = "the arm carries a mass that the model does not know"
    equation = "tau = m Y(q, qd, qdd; centre of mass)"
    neighbours = ("gravity_bias", "copper_loss")
    experiment = "the same motion with the gripper empty and with a known mass, tool vertical and horizontal"
    acts_on = "torque"
    shapes = ({"centre_of_mass_m": 0.0}, {"centre_of_mass_m": 0.06}, {"centre_of_mass_m": 0.15})
    bounds: ClassVar = {"centre_of_mass_m": (-0.1, 0.4)}
    c_body = """
    const lanes_t mass = c[0] + c[1] * p->tool;
    last_link_torque_lanes(&p->posture, body, torque);
    for (int k = 0; k < AXES; k++)
        torque[k] *= mass;
    """

    def at(self, scene: Scene, shape: Shape) -> Floats:
        """[N, 1 or 2] W/kg: always, and while the tool is on if the recording has a tool signal."""
        always = point_mass_power(scene, shape["centre_of_mass_m"])
        return np.column_stack([always, *([always * scene.signals["tool"]] if "tool" in scene.signals else [])])

    def places(self, scene: Scene) -> Iterator[Place]:
        """The flange, always or with the tool."""
        yield Place("flange", (0,), (Parameter("mass", "kg"),))
        if "tool" in scene.signals:
            yield Place("flange, while the tool is on", (1,), (Parameter("mass", "kg"),))

    def c_constants(self, carrier: GreyBox, shape: Shape) -> dict[str, float | Floats]:
        """Inertial parameters [10] of 1 kg."""
        return {"body": point_mass(carrier.chain.beyond_flange(shape["centre_of_mass_m"]))}

    def signals_of(self, columns: Sequence[int]) -> set[str]:
        """The tool, for the mass that comes and goes with the tool."""
        return {"tool"} if 1 in columns else set()
