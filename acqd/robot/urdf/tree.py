"""The tree of links and joints of a URDF, with what its elements say."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

Kind = Literal["fixed", "revolute", "continuous", "prismatic", "floating", "planar"]
Triple = tuple[float, float, float]
ZERO: Triple = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Origin:
    """A pose in the frame of the element's owner."""

    xyz: Triple = ZERO
    """m."""
    rpy: Triple = ZERO
    """rad."""


@dataclass(frozen=True, slots=True)
class Inertial:
    """Mass and tensor of a link; `origin` is the centre of mass with the tensor's axes."""

    origin: Origin
    mass: float
    """kg."""
    tensor: tuple[float, float, float, float, float, float]
    """xx, yy, zz, xy, xz, yz [kg m^2]."""


@dataclass(frozen=True, slots=True)
class Shape:
    """A collision body: `cylinder` (radius, length), `sphere` (radius), `box` (three edges) in m, or `mesh`."""

    kind: str
    size: tuple[float, ...]
    origin: Origin


@dataclass(frozen=True, slots=True)
class UrdfLink:
    """A link."""

    name: str
    inertial: Inertial | None
    shapes: tuple[Shape, ...]


@dataclass(frozen=True, slots=True)
class UrdfJoint:
    """A joint; what its element does not give is None. Angles in rad, lengths in m, efforts in Nm or N."""

    name: str
    kind: Kind
    parent: str
    child: str
    origin: Origin
    axis: Triple
    lower: float | None
    upper: float | None
    velocity: float | None
    effort: float | None
    mimics: str | None
    friction: float
    """Coulomb friction, 0 when not given."""
    damping: float
    """Viscous friction, 0 when not given."""

    @property
    def moves(self) -> bool:
        """Whether the joint has a degree of freedom."""
        return self.kind != "fixed"


@dataclass(frozen=True, slots=True)
class Urdf:
    """A tree of links."""

    path: Path
    name: str
    links: dict[str, UrdfLink]
    joints: list[UrdfJoint]
    children: dict[str, list[UrdfJoint]] = field(default_factory=dict)
    """Joints by the name of their parent link."""
    above: dict[str, UrdfJoint] = field(default_factory=dict)
    """The joint above a link, by the name of the link."""

    @property
    def root(self) -> str:
        """The link without a joint above."""
        return next(name for name in self.links if name not in self.above)


def below(urdf: Urdf, link: str) -> Iterator[str]:
    """`link` and all links that hang on it."""
    yield link
    for joint in urdf.children.get(link, []):
        yield from below(urdf, joint.child)
