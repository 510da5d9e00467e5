"""A heavier link."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from acqd.arrays import Floats
from acqd.models.effects.bodies import (
    centres_of,
    link_centres,
    link_torques,
    moments_about,
    point_mass,
    weight_torques,
)
from acqd.models.effects.cause import Cause
from acqd.models.effects.given_torques import GivenTorques
from acqd.models.effects.limits import Limits
from acqd.models.effects.places import Parameter, Place, Shape
from acqd.models.effects.scene import Scene
from acqd.models.greybox.model import GreyBox
from acqd.robot.newton_euler import Chain

_USUAL_SHARE, _USUAL_KG = 0.25, 0.5
"""Prior deviation of what is mounted on a link: a share of the link's mass, and hoses in kg."""
_BESIDE_M = 0.1
"""Prior deviation of the place of that mass from the link's centre of mass."""
_WRIST = 3
"""Last links: a mass there acts on the joints like a payload."""


class GravityBias(GivenTorques):
    """A mass on a link: hoses, a dress pack. A weight without inertia is that of a spring or a missing counterweight.

    The first link has no column: its weight acts on no joint when the base is upright.
    """

    id = "gravity_bias"
    cause = Cause.LOAD
    summary = "one link is heavier (or lighter) than the model has it: hoses, a dress pack, a cover gone"
    equation = "tau = m Y(q, qd, qdd; link), or m g(q; link)"
    neighbours = ("payload",)
    experiment = "hold ten postures for ten seconds each, and move each joint through the vertical, slowly and fast"
    at_link = True
    simplification = 0.15  # the mass sits 3 cm beside the described centre of mass, whose lever is about 20 cm
    c_body = """
    double inertial[AXES][10] = {{0.0}};
    int heavy = 0;
    for (int link = 1; link < AXES; link++) {
        lanes_t weight[AXES];
        for (int i = 0; i < 10 && link <= upper_links; i++) {
            inertial[link][i] = c[AXES - 2 + link] * body[link][i];
            for (int side = 0; side < 2; side++)
                inertial[link][i] += c[AXES - 3 + upper_links + 2 * link + side] * first_moment[link][side][i];
            heavy |= inertial[link][i] != 0.0;
        }
        if (c[link - 1] == 0.0)
            continue;
        weight_torque_lanes(&p->posture, link, centre[link], weight);
        for (int k = 0; k < AXES; k++)
            torque[k] += c[link - 1] * weight[k];
    }
    if (heavy) {
        lanes_t more[AXES];
        joint_torque_lanes(&p->posture, (const double (*)[10])inertial, more);
        for (int k = 0; k < AXES; k++)
            torque[k] += more[k];
    }
    """

    def count(self, scene: Scene) -> int:
        """A weight on every link from the second on; of the links below the wrist a mass and two first moments, too."""
        return scene.axes - 1 + 3 * len(_upper_links(scene.axes))

    def torque_of(self, scene: Scene, column: int) -> Floats:
        """[N, axes] Nm/kg of a weight or mass at the described centre of mass of a link.

        Of first moments beside the centre, across the joint's axis: Nm/(kg m).
        """
        centres = link_centres(scene)
        if column < scene.axes - 1:
            points = [(k, centres[k]) for k in range(1, scene.axes)]
            return np.asarray(weight_torques(scene, "weights of links", points)[column])
        bodies = _bodies(scene.model.chain, centres)
        return np.asarray(link_torques(scene, "masses on links", bodies)[column - scene.axes + 1])

    def places(self, scene: Scene) -> Iterator[Place]:
        """Links from the second on: a weight; below the wrist also a mass, at the centre or beside the centre."""
        masses, limits = scene.model.group("inertial")[::10], Limits.of(scene.model)
        upper, weights = _upper_links(scene.axes), scene.axes - 1
        for k in range(1, scene.axes):
            usual_kg = _USUAL_SHARE * float(masses[k]) + _USUAL_KG
            weight = Parameter("mass", "kg", -limits.arm_kg, limits.arm_kg, usual_kg)
            yield Place(f"link {k + 1}, weight only" if k in upper else f"link {k + 1}", (k - 1,), (weight,))
            if k in upper:
                # a fitted link has the mass of its neighbours within the usual deviation
                mass = replace(weight, low=max(weight.low, -float(masses[k]) - usual_kg))
                most = limits.moment_kg_m
                moments = (
                    Parameter(f"first moment {side}", "kg m", -most, most, usual_kg * _BESIDE_M) for side in "xy"
                )
                own, first = weights + k - 1, weights + len(upper) + 2 * (k - 1)
                yield Place(f"link {k + 1}", (own,), (mass,))
                yield Place(f"link {k + 1}, beside its centre", (own, first, first + 1), (mass, *moments))

    def simplified(self, place: Place) -> float:
        """None where the place of the mass is fitted."""
        return 0.0 if len(place.columns) > 1 else self.simplification

    def c_constants(self, carrier: GreyBox, shape: Shape) -> dict[str, float | Floats]:
        """Centres of mass [axes, 3] m, inertial parameters per kg and per kg m, number of links below the wrist."""
        centres = centres_of(carrier.group("inertial"))
        sides = [moments_about(centre, axis) for centre, axis in zip(centres, carrier.chain.axis, strict=True)]
        return {
            "centre": centres, "body": np.array([point_mass(centre) for centre in centres]),
            "first_moment": np.array(sides), "upper_links": len(_upper_links(carrier.axes)),
        }  # fmt: skip


def _bodies(chain: Chain, centres: Floats) -> list[tuple[int, Floats]]:
    """Link (from 0) and inertial parameters [10] of every column of a mass or a first moment."""
    upper = _upper_links(len(centres))
    masses = [(k, point_mass(centres[k])) for k in upper]
    return masses + [(k, each) for k in upper for each in moments_about(centres[k], chain.axis[k])]


def _upper_links(axes: int) -> range:
    """Numbers (from 0) of the links between the first and the wrist."""
    return range(1, max(axes - _WRIST, 1))
