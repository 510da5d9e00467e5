"""A joint whose zero has moved."""

from __future__ import annotations

from collections.abc import Iterator

from acqd.arrays import Floats
from acqd.models.effects.cause import Cause
from acqd.models.effects.given_torques import GivenTorques
from acqd.models.effects.places import Parameter, Place
from acqd.models.effects.scene import Scene
from acqd.robot.newton_euler import joint_torque
from acqd.robot.rigid_body import Turned, turned_by

_USUAL, _LARGEST = 0.02, 0.35
"""rad (m of prismatic joints): prior deviation, and the largest shift that columns at the logged angle describe."""
_STEP = 1e-4
"""Of the central difference."""


class JointZero(GivenTorques):
    """The arm stands elsewhere than the logged angle says: a joint was mastered again, or a belt has jumped."""

    id = "joint_zero"
    cause = Cause.LOAD
    summary = "a joint stands elsewhere than its logged angle says: mastered again, a belt that jumped, a lost zero"
    equation = "tau = dq dtau/dq(q, qd, qdd)"
    neighbours = ("gravity_bias", "mounting", "payload")
    experiment = "move every joint to its mark of zero, and compare the marks with the logged angles"
    at_link = True
    exported = False
    omitted_because = "an FMU assumes joints that stand where their angles say"

    def count(self, scene: Scene) -> int:
        """The joints."""
        return scene.axes

    def torque_of(self, scene: Scene, column: int) -> Floats:
        """[N, axes] Nm per rad (N, m of prismatic joints) by which a joint stands beyond its logged angle."""
        known: dict[int, Floats] = scene.moved.setdefault("joint_zero", {})
        if column not in known:
            chain, links = scene.model.chain, scene.model.group("inertial")
            after, before = (
                joint_torque(chain, links, q, scene.qd, scene.qdd, turned=turned)
                for q, turned in (_moved(scene, column, step) for step in (_STEP, -_STEP))
            )
            known[column] = (after - before) / (2 * _STEP)
        return known[column]

    def places(self, scene: Scene) -> Iterator[Place]:
        """Joints one by one: which are mastered again together is a fact of the day, no law."""
        for k in range(scene.axes):
            unit = "m" if k in scene.model.layout.sliding else "rad"
            yield Place(f"joint {k + 1}", (k,), (Parameter("shift", unit, -_LARGEST, _LARGEST, _USUAL),))


def _moved(scene: Scene, column: int, step: float) -> tuple[Floats, Turned]:
    """[N, axes] angles of which one joint's are a step on, and their cosine and sine."""
    q, cosine, sine = (each.copy() for each in (scene.q, *scene.turned))
    q[:, column] += step
    cosine[:, column], sine[:, column] = turned_by(q[:, column])
    return q, (cosine, sine)
