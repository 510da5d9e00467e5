"""The parts of a URDF file that a robot description needs, as they are written there (wiki.ros.org/urdf/XML).

urdfdom, which Pinocchio uses, refuses a whole file when one limit is missing, without the joint's name, and reads a
link without inertia as a link without mass. Both have to be named here, so the XML is read directly; Pinocchio's
reader is the oracle of the tests.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from pathlib import Path
from typing import get_args
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from acqd.errors import InputError
from acqd.robot.urdf.tree import ZERO, Inertial, Kind, Origin, Shape, Triple, Urdf, UrdfJoint, UrdfLink, below

_MOST_RAD = 2 * math.pi + 0.01
"""Largest angle of a frame: no tool writes more than a turn."""
_OTHERS = {
    "sdf": "; export the model as URDF, or convert it: sdf2urdf",
    "mujoco": "; export the model as URDF",
    "COLLADA": "; this is a mesh",
}
"""What to do with files of other simulators."""
_UNIT = 0.01  # by which the length of a rounded quaternion may differ from 1
_SMALLEST, _LARGEST = 1e-12, 1e12  # in m, kg, Nm, rad/s; beyond, products of values overflow


def read_urdf(path: Path) -> Urdf:
    """Read a URDF. Raises InputError that names the element."""
    try:
        content = path.read_bytes().strip(b"\x00 \r\n\t") if not _is_utf16(path) else path.read_bytes()
        _require_xml(path, content)
        if b"<!DOCTYPE" in content:  # entities could multiply to gigabytes; no URDF has any
            raise InputError(path, "has a document type; a URDF needs none: delete it")
        robot = ElementTree.fromstring(_decoded(path, content))  # noqa: S314 (no document type, no entities)
    except OSError as error:
        raise InputError(path, f"cannot be read ({error.strerror})") from None
    except ElementTree.ParseError as error:
        raise InputError(path, f"is not valid XML ({error}); expected a URDF") from None
    for element in robot.iter():
        element.tag = re.sub(r"^\{(?![^}]*xacro)[^}]*\}", "", element.tag) if isinstance(element.tag, str) else "!"
    if robot.tag != "robot":
        remedy = _OTHERS.get(robot.tag, "")
        raise InputError(path, f"starts with <{robot.tag}>; expected the <robot> of a URDF{remedy}")
    if any("xacro" in element.tag for element in robot.iter()):
        raise InputError(path, "is a xacro file; expand it first: xacro FILE > robot.urdf")
    read = _Reader(path)
    links: dict[str, UrdfLink] = {}
    for element in robot.findall("link"):
        link = read.link(element)
        if link.name in links:
            raise InputError(path, f"link {link.name!r} is there twice")
        links[link.name] = link
    joints = [read.joint(element) for element in robot.findall("joint")]
    urdf = Urdf(path, robot.get("name") or path.stem, links, joints)
    _connect(urdf)
    return urdf


def _is_utf16(path: Path) -> bool:
    with path.open("rb") as file:
        return file.read(2) in (b"\xff\xfe", b"\xfe\xff")


def _require_xml(path: Path, content: bytes) -> None:
    """Raises InputError for files that are often found in the place of a URDF."""
    head = content[:200].lower()
    if not content:
        raise InputError(path, "is empty; expected a URDF")
    if head.startswith(b"version https://git-lfs"):
        raise InputError(path, "is only a pointer of Git LFS; fetch the file itself: git lfs pull")
    if b"<html" in head or b"<!doctype html" in head:
        raise InputError(path, "is a web page, not a URDF; download the file itself (on GitHub: Raw)")
    if head.startswith((b"pk\x03\x04", b"\x1f\x8b")):
        raise InputError(path, "is compressed; unpack it first")


def _decoded(path: Path, content: bytes) -> str | bytes:
    """The text of an XML file whose declaration names an encoding that the parser does not know. Raises InputError."""
    declared = re.match(rb"<\?xml[^>]*?encoding=[\"']([A-Za-z0-9._-]+)[\"'][^>]*?\?>", content.lstrip())
    if declared is None or declared[1].lower() in (b"utf-8", b"us-ascii", b"utf-16", b"iso-8859-1"):
        if _parses_as_declared(declared, content):
            return content
        return re.sub(r"^<\?xml.*?\?>", "", content.decode("cp1252", "replace"))
    name = declared[1].decode("ascii")
    try:
        text = content.lstrip().decode(name)
    except LookupError:
        raise InputError(path, f"is written in {name!r}, an unknown encoding; save the file as UTF-8") from None
    except UnicodeDecodeError:
        raise InputError(path, f"is not written in {name!r}, as its first line says; save the file as UTF-8") from None
    return text[text.index("?>") + 2 :]


def _parses_as_declared(declared: re.Match[bytes] | None, content: bytes) -> bool:
    """Whether bytes that should be UTF-8 are; comments are often in the code page of an old editor."""
    name = declared[1].lower() if declared is not None else b"utf-8"
    if name not in (b"utf-8", b"us-ascii") or content[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return True
    try:
        content.decode("utf-8")
    except UnicodeDecodeError:
        return False
    return True


def _connect(urdf: Urdf) -> None:
    """Fill the maps of the tree. Raises InputError unless the links are one tree."""
    names: set[str] = set()
    for joint in urdf.joints:
        for end in (joint.parent, joint.child):
            if end not in urdf.links:
                raise InputError(urdf.path, f"joint {joint.name!r} names link {end!r}, which is not in the file")
        if joint.child in urdf.above:
            raise InputError(urdf.path, f"link {joint.child!r} hangs on two joints; a URDF is a tree")
        if joint.name in names:
            raise InputError(urdf.path, f"joint {joint.name!r} is there twice")
        names.add(joint.name)
        urdf.above[joint.child] = joint
        urdf.children.setdefault(joint.parent, []).append(joint)
    roots = [name for name in urdf.links if name not in urdf.above]
    if len(roots) != 1:
        raise InputError(urdf.path, f"has {len(roots)} links without a parent ({', '.join(roots[:4])}); expected one")
    if sum(1 for _ in below(urdf, roots[0])) < len(urdf.links):
        raise InputError(urdf.path, "has a loop of joints; a URDF is a tree")


@dataclass(frozen=True, slots=True)
class _Reader:
    """Elements to dataclasses; errors name the file and the element."""

    path: Path

    def link(self, element: Element) -> UrdfLink:
        name = self._name(element)
        inertial = self._only(element, "inertial", name)
        shapes = [self._shape(each, name) for each in element.findall("collision")]
        return UrdfLink(
            name, None if inertial is None else self._inertial(inertial, name), tuple(s for s in shapes if s)
        )

    def joint(self, element: Element) -> UrdfJoint:
        name, kind = self._name(element), element.get("type", "")
        if kind not in get_args(Kind):
            raise InputError(
                self.path, f"joint {name!r} has type {kind!r}; expected one of {', '.join(get_args(Kind))}"
            )
        limit, dynamics, mimic, axis = (
            self._only(element, tag, name) for tag in ("limit", "dynamics", "mimic", "axis")
        )
        direction: Triple = (1.0, 0.0, 0.0) if axis is None else self._triple(axis, "xyz", name, (1.0, 0.0, 0.0))
        if kind not in ("fixed", "floating") and not any(direction):
            raise InputError(self.path, f"joint {name!r}: axis 0 0 0 has no direction")
        lower, upper, velocity, effort = (
            self._limit(limit, key, name) for key in ("lower", "upper", "velocity", "effort")
        )
        return UrdfJoint(
            name,
            kind,  # type: ignore[arg-type]
            self._end(element, "parent", name),
            self._end(element, "child", name),
            self._origin(element, name),
            direction,
            lower,
            upper,
            velocity,
            effort,
            None if mimic is None else mimic.get("joint", "?"),
            self._number(dynamics, "friction", name) or 0.0,
            self._number(dynamics, "damping", name) or 0.0,
        )

    def _inertial(self, element: Element, name: str) -> Inertial | None:
        mass = self._number(self._only(element, "mass", name), "value", name)
        if mass is None or mass == 0.0:
            return None
        if mass < 0.0:
            raise InputError(self.path, f"{name!r}: mass {mass:g} kg is negative")
        tensor = self._only(element, "inertia", name)
        xx, yy, zz, xy, xz, yz = (
            self._number(tensor, key, name) or 0.0 for key in ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
        )
        return Inertial(self._origin(element, name), mass, (xx, yy, zz, xy, xz, yz))

    def _shape(self, element: Element, name: str) -> Shape | None:
        geometry = element.find("geometry")
        body = None if geometry is None else next(iter(geometry), None)
        if body is None:
            return None
        size: tuple[float, ...] = ()
        if body.tag == "box":
            size = self._triple(body, "size", name, ZERO)
        elif body.tag in ("cylinder", "capsule", "sphere"):
            size = tuple(self._number(body, key, name) or 0.0 for key in ("radius", "length"))
        kind = body.tag if body.tag in ("box", "cylinder", "capsule", "sphere") and size[0] > 0 else "mesh"
        return Shape(kind, size, self._origin(element, name))

    def _only(self, element: Element, tag: str, name: str) -> Element | None:
        """The one element of a kind; parsers of URDF differ in which of several they take."""
        found = element.findall(tag)
        if len(found) > 1:
            remedy = "a body has one mass: merge them" if tag == "inertial" else "expected one: remove the others"
            raise InputError(self.path, f"{name!r} has more than one <{tag}>; {remedy}")
        return found[0] if found else None

    def _name(self, element: Element) -> str:
        name = element.get("name")
        if not name:
            raise InputError(self.path, f"a <{element.tag}> has no name")
        return name

    def _end(self, element: Element, tag: str, name: str) -> str:
        end = self._only(element, tag, name)
        link = None if end is None else end.get("link")
        if not link:
            raise InputError(self.path, f"joint {name!r} has no <{tag} link=...>")
        return link

    def _origin(self, element: Element, name: str) -> Origin:
        origin = self._only(element, "origin", name)
        if origin is None:
            return Origin()
        rpy = self._triple(origin, "rpy", name, ZERO)
        if max(map(abs, rpy)) > _MOST_RAD:
            raise InputError(
                self.path, f"{name!r}: rpy={origin.get('rpy')!r} turns by more than a whole turn: in degrees? Write rad"
            )
        if origin.get("quat_xyzw") is not None:  # URDF 1.1
            if origin.get("rpy") is not None:
                raise InputError(self.path, f"{name!r}: <origin> has both rpy and quat_xyzw; expected one of them")
            rpy = self._rpy(origin, name)
        return Origin(self._triple(origin, "xyz", name, ZERO), rpy)

    def _rpy(self, origin: Element, name: str) -> Triple:
        """Roll, pitch and yaw of the quaternion x y z w."""
        text = origin.get("quat_xyzw", "")
        values = [self._value(part, "quat_xyzw", name) for part in text.split()]
        length = math.sqrt(sum(value * value for value in values))
        if len(values) != 4 or abs(length - 1.0) > _UNIT:
            raise InputError(self.path, f"{name!r}: quat_xyzw={text!r}; expected four numbers of a unit quaternion")
        x, y, z, w = (value / length for value in values)
        sine = max(-1.0, min(1.0, 2 * (w * y - z * x)))
        if abs(sine) > 1.0 - 1e-9:  # pitch of 90 degrees: roll and yaw turn about one axis
            return 0.0, math.copysign(math.pi / 2, sine), -2 * math.copysign(math.atan2(x, w), sine)
        roll = math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
        return roll, math.asin(sine), math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))

    def _triple(self, element: Element, key: str, name: str, default: Triple) -> Triple:
        text = element.get(key)
        if text is None:
            return default
        values = [self._value(part, key, name) for part in text.split()]
        if len(values) != 3:
            raise InputError(self.path, f"{name!r}: {key}={text!r}; expected three numbers")
        return values[0], values[1], values[2]

    def _limit(self, element: Element | None, key: str, name: str) -> float | None:
        """A limit; None, as if missing, where a tool wrote the largest number that it has."""
        text = "" if element is None else element.get(key, "")
        try:
            unlimited = abs(float(text)) >= _LARGEST
        except ValueError:
            unlimited = False
        return None if unlimited else self._number(element, key, name)

    def _number(self, element: Element | None, key: str, name: str) -> float | None:
        text = None if element is None else element.get(key)
        return None if text is None else self._value(text, key, name)

    def _value(self, text: str, key: str, name: str) -> float:
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if "${" in text:
            raise InputError(
                self.path, f"{name!r}: {key}={text!r} is of a xacro file; expand it: xacro FILE > robot.urdf"
            )
        if not abs(value) < _LARGEST:
            raise InputError(self.path, f"{name!r}: {key}={text!r} is no number, or larger than a robot can have")
        return 0.0 if abs(value) < _SMALLEST else value
