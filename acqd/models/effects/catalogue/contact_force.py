"""Contact of the tool with its surroundings."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from acqd.arrays import Floats
from acqd.models.effects.bodies import GRAVITY, powers, weight_torques
from acqd.models.effects.cause import Cause
from acqd.models.effects.effect import Effect
from acqd.models.effects.limits import Limits
from acqd.models.effects.places import Parameter, Place, Shape
from acqd.models.effects.scene import Scene
from acqd.models.greybox.model import GreyBox


class ContactForce(Effect):
    """An upward force on the flange for some seconds at a time; the residual determines when.

    A model holds its mean, because motion and signals do not tell when contact occurs.
    """

    id = "contact_force"
    cause = Cause.LOAD
    summary = "the tool pushes against something for some seconds at a time"
    equation = "tau = -J(q)^T F while in contact"
    neighbours = ("process_load", "payload")
    experiment = "log the joint torques, or the times of contact"
    at_link = True
    predictable = False
    structural = False
    detected = "contact"
    simplification = 0.1  # a force that is inclined by 10 to 20 degrees has a horizontal part, which the arm feels too
    c_body = """
    lanes_t weight[AXES];
    weight_torque_lanes(&p->posture, AXES - 1, tip, weight);
    for (int k = 0; k < AXES; k++)
        power -= p->power_per_torque[k] * weight[k] / 9.81;
    power *= c[0] * share_of_time;
    """

    def at(self, scene: Scene, shape: Shape) -> Floats:
        """[N, 1] W/N of an upward force on the flange, times the share of time; no columns without a shape."""
        if not shape:
            return np.zeros((len(scene.q), 0))
        flange = [(scene.axes - 1, scene.model.chain.beyond_flange(0.0))]
        weight = powers(scene, weight_torques(scene, "weight at the flange", flange))
        return shape["share_of_time"] * (-weight / GRAVITY)

    def places(self, scene: Scene) -> Iterator[Place]:
        """No places before detection."""
        return iter(())

    def detected_place(self, shape: Shape, model: GreyBox) -> Place:
        """The flange."""
        most_N = Limits.of(model).lifting_force
        return Place("flange", (0,), (Parameter("force up", "N", -most_N, most_N),))

    def c_constants(self, carrier: GreyBox, shape: Shape) -> dict[str, float | Floats]:
        """The flange [3] m in the last link's frame, and the share of time."""
        return {"tip": carrier.chain.beyond_flange(0.0), "share_of_time": float(shape["share_of_time"])}
