"""A base that is not mounted as described."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from acqd.arrays import Floats
from acqd.models.effects.bodies import GRAVITY
from acqd.models.effects.cause import Cause
from acqd.models.effects.given_torques import GivenTorques
from acqd.models.effects.places import Parameter, Place
from acqd.models.effects.scene import Scene
from acqd.robot.newton_euler import Chain, joint_torques

_TILT, _TURNED = 0.05, 0.5
"""Prior deviations over gravity: 3 degrees of a floor or a pedestal; a robot on a wall or under a ceiling."""
_MOST = 3.0
"""Over gravity: from upright to hanging it changes by 2; the masses of the model may be too small."""
_FELT = 1e-6
"""Of the largest torque: rounding. One joint feels nothing of gravity along its axis."""


class Mounting(GivenTorques):
    """Gravity acts in another direction of the base than described: a tilted pedestal, a wall, a ceiling."""

    id = "mounting"
    cause = Cause.LOAD
    summary = "the base is not mounted as the model has it: tilted, on a wall or under a ceiling"
    equation = "tau = dg dtau/dg(q)"
    neighbours = ("gravity_bias", "joint_zero", "payload")
    experiment = "turn joint 1 slowly once round with the arm stretched out: a tilt lifts the arm on one side"
    at_link = True
    exported = False
    omitted_because = "an FMU assumes the described mounting"

    def count(self, scene: Scene) -> int:
        """The axes of the base."""
        return 3

    def torque_of(self, scene: Scene, column: int) -> Floats:
        """[N, axes] Nm per m/s^2 by which gravity pulls along x, y or z of the base beside the described one."""
        return np.asarray(_torques(scene)[column])

    def places(self, scene: Scene) -> Iterator[Place]:
        """The base: tilted by a few degrees, or turned over; along the axes that some joint feels."""
        sizes, most = np.abs(_torques(scene)).max(axis=(1, 2)), _MOST * GRAVITY
        felt = sizes > _FELT * sizes.max()
        for where, axes, usual in (("base, tilted", (0, 1), _TILT), ("base, turned", (0, 1, 2), _TURNED)):
            own = tuple(axis for axis in axes if felt[axis])
            named = (Parameter(f"gravity {'xyz'[axis]}", "m/s^2", -most, most, usual * GRAVITY) for axis in own)
            if own:
                yield Place(where, own, tuple(named))


def _torques(scene: Scene) -> Floats:
    """[3, N, axes] Nm per m/s^2 of gravity along the axes of the base."""
    if "mounting" not in scene.moved:
        still, links = np.zeros_like(scene.q), scene.model.group("inertial")[None]
        scene.moved["mounting"] = np.concatenate(
            [
                -joint_torques(_turned(scene.model.chain, axis), links, scene.q, still, still, turned=scene.turned)
                / GRAVITY
                for axis in range(3)
            ]
        )
    return np.asarray(scene.moved["mounting"])


def _turned(chain: Chain, axis: int) -> Chain:
    """The chain on a base whose axis 0, 1 or 2 points up: gravity pulls against that axis."""
    turn = np.roll(np.eye(3), 2 - axis, axis=0)  # rows: the axes that become x, y and z
    return replace(
        chain,
        xyz=np.concatenate([chain.xyz[:1] @ turn.T, chain.xyz[1:]]),
        rotation=np.concatenate([(turn @ chain.rotation[0])[None], chain.rotation[1:]]),
    )
