"""A heavier link."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from acqd.arrays import Floats
from acqd.models.effects.bodies import centres_of, link_centres, weight_power
from acqd.models.effects.effect import Effect
from acqd.models.effects.places import Parameter, Place, Shape
from acqd.models.effects.scene import Scene
from acqd.models.greybox.model import GreyBox

_USUAL_SHARE, _USUAL_KG = 0.25, 0.5
"""Prior deviation of what is mounted on a link: a share of the link's mass, and hoses in kg."""


class GravityBias(Effect):
    """Additional weight on a link, or a spring: hoses, a dress pack, a missing counterweight.

    The first link has no column: its weight acts on no joint when the base is upright.
    """

    id = "gravity_bias"
    summary = "one link is heavier (or lighter) than the model has it: hoses, a dress pack, a cover gone"
    equation = "tau = m g(q; link)"
    neighbours = ("payload",)
    experiment = "hold ten postures for ten seconds each, and move each joint alone through the vertical"
    acts_on = "torque"
    at_link = True
    simplification = 0.15  # the mass sits 3 cm beside the described centre of mass, whose lever is about 20 cm
    c_body = """
    for (int link = 1; link < AXES; link++) {
        lanes_t weight[AXES];
        if (c[link - 1] == 0.0)
            continue;
        weight_torque_lanes(&p->posture, link, centre[link], weight);
        for (int k = 0; k < AXES; k++)
            torque[k] += c[link - 1] * weight[k];
    }
    """

    def at(self, scene: Scene, shape: Shape) -> Floats:
        """[N, axes - 1] W/kg at the described centre of mass of every link from the second on."""
        centres = link_centres(scene)
        return np.column_stack([weight_power(scene, k, centres[k]) for k in range(1, scene.axes)])

    def places(self, scene: Scene) -> Iterator[Place]:
        """Links from the second on."""
        masses = scene.model.group("inertial")[::10]
        for k in range(1, scene.axes):
            usual_kg = _USUAL_SHARE * float(masses[k]) + _USUAL_KG
            yield Place(f"link {k + 1}", (k - 1,), (Parameter("mass", "kg", deviation=usual_kg),))

    def c_constants(self, carrier: GreyBox, shape: Shape) -> dict[str, float | Floats]:
        """Centres of mass [axes, 3] m."""
        return {"centre": centres_of(carrier.group("inertial"))}
