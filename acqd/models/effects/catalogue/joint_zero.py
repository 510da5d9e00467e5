"""A joint whose zero has moved."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import overload

import numpy as np

from acqd.arrays import Floats
from acqd.models.effects.cause import Cause
from acqd.models.effects.given_torques import GivenTorques
from acqd.models.effects.places import Parameter, Place
from acqd.models.effects.scene import Scene
from acqd.robot.newton_euler import joint_torque

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

    def torques(self, scene: Scene) -> Sequence[Floats]:
        """[N, axes] Nm per rad (N, m of prismatic joints) by which each joint stands beyond its logged angle."""
        return _Shifted(scene)

    def places(self, scene: Scene) -> Iterator[Place]:
        """Joints one by one: which are mastered again together is a fact of the day, no law."""
        for k in range(scene.axes):
            unit = "m" if k in scene.model.layout.sliding else "rad"
            yield Place(f"joint {k + 1}", (k,), (Parameter("shift", unit, -_LARGEST, _LARGEST, _USUAL),))


class _Shifted(Sequence[Floats]):
    """Torques per shift, joint by joint: a search of one joint asks for that one only."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._known: dict[int, Floats] = scene.moved.setdefault("joint_zero", {})

    def __len__(self) -> int:
        return self._scene.axes

    @overload
    def __getitem__(self, joint: int) -> Floats: ...
    @overload
    def __getitem__(self, joint: slice) -> Sequence[Floats]: ...
    def __getitem__(self, joint: int | slice) -> Floats | Sequence[Floats]:
        if isinstance(joint, slice):
            return [self[k] for k in range(len(self))[joint]]
        k = range(len(self))[joint]
        if k not in self._known:
            step = _STEP * np.eye(len(self))[k]
            self._known[k] = (self._at(step) - self._at(-step)) / (2 * _STEP)
        return self._known[k]

    def _at(self, shift: Floats) -> Floats:
        scene = self._scene
        return joint_torque(scene.model.chain, scene.model.group("inertial"), scene.q + shift, scene.qd, scene.qdd)
