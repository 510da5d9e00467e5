"""Collisions of a robot with itself and its surroundings: capsules and boxes, by the library coal."""

from __future__ import annotations

import itertools
from functools import cache
from typing import Any

import coal
import numpy as np
import pinocchio as pin

from acqd.arrays import Floats
from acqd.errors import UserError
from acqd.robot.arm import Arm
from acqd.robot.description import Capsule
from acqd.robot.scene import Scene


class CollisionChecker:
    """Checks configurations and joint-space paths of one arm in one scene."""

    def __init__(self, arm: Arm, scene: Scene) -> None:
        self._arm = arm
        self._model: Any = pin.GeometryModel()
        links: list[tuple[int, int]] = []  # (geometry, link number; 0 is the base)
        bodies = [arm.description.base.capsules, *(joint.capsules for joint in arm.description.joint)]
        for number, capsules in enumerate(bodies):
            links += [(self._add_capsule(number, capsule, pin.SE3.Identity()), number) for capsule in capsules]
        flange = arm.model.frames[arm.flange].placement
        tool = arm.axes + 1
        for capsule in scene.tool.capsules if scene.tool else []:
            links.append((self._add_capsule(arm.axes, capsule, flange), tool))
        boxes = [self._add_box(box.name, box.centre, box.size, box.rpy_deg) for box in scene.box]
        ignored = {tuple(sorted(pair)) for pair in arm.description.ignore_pairs}
        for index, (geometry, link) in enumerate(links):
            for other_geometry, other in links[index + 1 :]:
                adjacent = abs(link - other) < 2 or {link, other} == {arm.axes - 1, tool}
                if not adjacent and (min(link, other), max(link, other)) not in ignored:
                    self._model.addCollisionPair(pin.CollisionPair(geometry, other_geometry))
            if link > 0:  # the base does not move: it touches the box that it is bolted to
                for box in boxes:
                    self._model.addCollisionPair(pin.CollisionPair(geometry, box))
        self._data: Any = self._model.createData()
        for request in self._data.collisionRequests:
            request.security_margin = scene.margin_m

    def collides(self, q: Floats) -> bool:
        """Whether any two bodies are nearer than the scene's margin at configuration `q` [axes]."""
        return bool(pin.computeCollisions(self._arm.model, self._arm.data, self._model, self._data, q, True))

    def touching(self, q: Floats) -> list[tuple[str, str]]:
        """The pairs of bodies that collide at `q`, by name."""
        pin.computeCollisions(self._arm.model, self._arm.data, self._model, self._data, q, False)
        pairs = set()
        for pair, result in zip(self._model.collisionPairs, self._data.collisionResults, strict=True):
            if result.isCollision():
                names = [self._model.geometryObjects[index].name for index in (pair.first, pair.second)]
                pairs.add((names[0], names[1]))
        return sorted(pairs)

    def path_collides(self, path: Floats) -> bool:
        """Whether any configuration of `path` [T, axes] collides; a coarse check comes first."""
        return any(self.collides(path[k]) for k in _middle_first(len(path)))

    def _add_capsule(self, link: int, capsule: Capsule, frame: Any) -> int:
        start, end = np.array(capsule.start), np.array(capsule.end)
        along = end - start
        length = float(np.linalg.norm(along))
        turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), along if length else np.array([0.0, 0.0, 1.0]))
        placement = frame * pin.SE3(turn.matrix(), (start + end) / 2)
        name = "base" if link == 0 else f"link {link}"
        shape = coal.Capsule(capsule.radius, length)
        return self._add(name, link, placement, shape)

    def _add_box(
        self,
        name: str,
        centre: tuple[float, float, float],
        size: tuple[float, float, float],
        rpy_deg: tuple[float, float, float],
    ) -> int:
        placement = pin.SE3(pin.rpy.rpyToMatrix(np.radians(rpy_deg)), np.array(centre))
        return self._add(f"box {name!r}", 0, placement, coal.Box(*size))

    def _add(self, name: str, joint: int, placement: Any, shape: Any) -> int:
        number: int = self._model.addGeometryObject(pin.GeometryObject(name, joint, 0, placement, shape))
        return number


def require_free(checker: CollisionChecker, q: Floats, what: str, scene: str) -> None:
    """Raises UserError that names the bodies that collide at configuration `q`."""
    pairs = checker.touching(q)
    if pairs:
        named = "; ".join(f"{first} and {second}" for first, second in pairs[:3])
        raise UserError(f"scene {scene}: {what} is in collision ({named}); move the boxes or choose another position")


def dense_path(waypoints: Floats, step: float) -> Floats:
    """Straight lines in joint space through `waypoints` [N, axes], at most `step` (rad) per axis between rows."""
    parts = [waypoints[:1]]
    for start, end in itertools.pairwise(waypoints):
        count = max(1, int(np.ceil(np.abs(end - start).max() / step)))
        parts.append(start + np.linspace(0.0, 1.0, count + 1)[1:, None] * (end - start))
    return np.concatenate(parts)


@cache
def _middle_first(count: int) -> list[int]:
    """0 .. count - 1, distant numbers first (bit reversal): neighbouring configurations mostly collide together."""
    return sorted(range(count), key=lambda k: f"{k:020b}"[::-1])
