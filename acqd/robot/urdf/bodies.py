"""The rigid bodies of an arm: links at fixed joints, and at joints of other branches, become one body.

Placements and inertias are added by Pinocchio's SE3 and Inertia.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pinocchio as pin

from acqd.arrays import Floats
from acqd.errors import InputError
from acqd.robot.joint import Capsule, has_negative_moment
from acqd.robot.urdf.branch import Branch
from acqd.robot.urdf.tree import Origin, Shape, Urdf, UrdfJoint, UrdfLink

_TINY_KG = 1e-3
"""An antenna or a frame of reference with a mass so that a simulator accepts it: its tensor changes nothing."""


@dataclass(slots=True)
class Body:
    """Everything that moves with one joint; the first body is the base."""

    placement: Any
    """pin.SE3 of the joint in the frame of the body before."""
    inertia: Any
    """pin.Inertia in the body's frame."""
    capsules: list[Capsule] = field(default_factory=list)
    links: list[str] = field(default_factory=list)
    without_mass: list[str] = field(default_factory=list)
    meshes: list[str] = field(default_factory=list)
    """Links with collision meshes, of which no capsule is made."""


@dataclass(frozen=True, slots=True)
class Bodies:
    """All bodies of an arm, base first, and what else the caller has to know."""

    bodies: list[Body]
    flange: Any
    """pin.SE3 in the frame of the last body."""
    locked: list[str]
    """Moving joints of other branches, which are held still."""


def merge_bodies(urdf: Urdf, branch: Branch) -> Bodies:
    """The bodies of `branch`. Raises InputError for moved bodies without mass.

    The base keeps the orientation of the URDF's root, because gravity acts along the root's -z.
    """
    bodies = [Body(pin.SE3.Identity(), pin.Inertia.Zero()) for _ in range(len(branch.joints) + 1)]
    where: dict[str, Any] = {}
    locked: list[str] = []
    number = {joint.name: k for k, joint in enumerate(branch.joints, start=1)}

    def visit(link: str, body: int, at: Any) -> None:
        where[link] = at
        _add(urdf, bodies[body], urdf.links[link], at, moved=body > 0)
        for joint in urdf.children.get(link, []):
            frame = at * _se3(joint.origin)
            if joint.name in number:
                bodies[number[joint.name]].placement = frame
                visit(joint.child, number[joint.name], pin.SE3.Identity())
            else:
                if joint.moves:
                    locked.append(joint.name)
                visit(joint.child, body, frame * _held(joint))

    visit(urdf.root, 0, pin.SE3.Identity())
    _require_masses(urdf, bodies)
    origin = where[branch.base].translation.copy()  # positions count from the base, along the root's axes
    bodies[1].placement = pin.SE3(bodies[1].placement.rotation, bodies[1].placement.translation - origin)
    bodies[0].capsules = [_shifted(capsule, -origin) for capsule in bodies[0].capsules]
    return Bodies(bodies, where[branch.flange], locked)


def _add(urdf: Urdf, body: Body, link: UrdfLink, at: Any, *, moved: bool) -> None:
    """Raises InputError for a tensor that no body has, where it matters: of a link that moves and is not tiny."""
    body.links.append(link.name)
    if link.inertial is None:
        body.without_mass.append(link.name)
    else:
        frame = at * _se3(link.inertial.origin)
        xx, yy, zz, xy, xz, yz = link.inertial.tensor
        tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        if has_negative_moment((xx, yy, zz, xy, xz, yz)):
            if moved and link.inertial.mass > _TINY_KG:
                text = f"{link.name!r}: <inertia> has a negative principal moment, which no body has"
                raise InputError(urdf.path, text)
            tensor = np.zeros((3, 3))
        turned = frame.rotation @ tensor @ frame.rotation.T
        np.fill_diagonal(turned, np.maximum(np.diag(turned), 0.0))  # a rounded zero may be negative
        body.inertia += pin.Inertia(link.inertial.mass, frame.translation, turned)
    for shape in link.shapes:
        if shape.kind == "mesh":
            body.meshes.append(link.name)
        else:
            body.capsules.append(_capsule(shape, at * _se3(shape.origin)))


def _require_masses(urdf: Urdf, bodies: list[Body]) -> None:
    moved = bodies[1:]
    empty = [body for body in moved if body.inertia.mass <= 0.0]
    if len(empty) == len(moved):
        raise InputError(urdf.path, "has no masses (<inertial>); power cannot be computed without, export them with it")
    if empty:
        links = ", ".join(empty[0].links[:3])
        raise InputError(
            urdf.path, f"link {links} moves and has no mass (<inertial>); give it one, or choose --base or --tip"
        )


def _held(joint: UrdfJoint) -> Any:
    """Displacement of a joint that is held at zero, or at the limit nearest to zero."""
    low, high = joint.lower, joint.upper
    q = 0.0 if low is None or high is None or low > high else min(max(0.0, low), high)
    axis = np.array(joint.axis) / max(float(np.linalg.norm(joint.axis)), 1e-12)
    if joint.kind == "prismatic":
        return pin.SE3(np.eye(3), axis * q)
    if joint.kind == "revolute":
        return pin.SE3(pin.AngleAxis(q, axis).matrix(), np.zeros(3))
    return pin.SE3.Identity()


def _capsule(shape: Shape, at: Any) -> Capsule:
    """A capsule of about the size of a cylinder, sphere or box."""
    if shape.kind == "box":
        long = int(np.argmax(shape.size))
        others = [edge for k, edge in enumerate(shape.size) if k != long]
        radius, length = math.hypot(*others) / 2, shape.size[long]
    else:
        long, (radius, straight) = 2, shape.size
        length = {"cylinder": straight, "capsule": straight + 2 * radius, "sphere": 2 * radius}[shape.kind]
    half = np.eye(3)[long] * max(length / 2 - radius, 0.0)
    return _made(rounded(radius), at.act(-half), at.act(half))


def _shifted(capsule: Capsule, by: Floats) -> Capsule:
    return _made(capsule.radius, np.array(capsule.start) + by, np.array(capsule.end) + by)


def _made(radius: float, start: Floats, end: Floats) -> Capsule:
    return Capsule.model_validate({"radius": radius, "from": triple(start), "to": triple(end)})


def _se3(origin: Origin) -> Any:
    return pin.SE3(pin.rpy.rpyToMatrix(*origin.rpy), np.array(origin.xyz))


def rounded(value: float) -> float:
    """Nine significant digits; nothing below 1e-12."""
    return 0.0 if abs(value) < 1e-12 else float(f"{value:.9g}")


def triple(values: Floats) -> tuple[float, float, float]:
    """Three rounded numbers."""
    x, y, z = (rounded(float(value)) for value in values)
    return x, y, z
