"""The joints of one arm in a URDF's tree: from a base link to a tip link. What is ambiguous is refused by name."""

from __future__ import annotations

from dataclasses import dataclass

from acqd.errors import InputError
from acqd.robot.urdf.tree import Urdf, UrdfJoint, below

_TOOL_FRAMES = ("tool0", "flange")
"""Names of the mounting face by ROS-Industrial's convention (REP 199)."""
_MOST_CANDIDATES = 6


@dataclass(frozen=True, slots=True)
class Branch:
    """One arm."""

    base: str
    """Link whose origin is the base's origin."""
    joints: list[UrdfJoint]
    """The moving joints in order."""
    flange: str
    """Link where tools are mounted."""
    notes: list[str]


def choose_branch(urdf: Urdf, base: str | None, tip: str | None) -> Branch:
    """The arm between two links. Raises InputError with the candidates where the file leaves a choice."""
    start = base or urdf.root
    for option, name in (("--base", base), ("--tip", tip)):
        if name is not None and name not in urdf.links:
            raise InputError(urdf.path, f"has no link {name!r} for {option}; its links are {listed(list(urdf.links))}")
    joints = _only_way(urdf, start) if tip is None else _up_to(urdf, start, tip)
    for joint in joints:
        _require_independent(urdf, joint, base is None)
    if not joints:
        raise InputError(urdf.path, f"has no moving joint between {start!r} and {tip or 'its end'!r}; choose --tip")
    flange, notes = (tip, []) if tip is not None else _flange(urdf, joints[-1].child)
    return Branch(start, joints, flange, notes)


def _up_to(urdf: Urdf, start: str, tip: str) -> list[UrdfJoint]:
    path: list[UrdfJoint] = []
    link = tip
    while link != start:
        joint = urdf.above.get(link)
        if joint is None:
            raise InputError(
                urdf.path, f"link {tip!r} (--tip) does not hang on {start!r} (--base); choose a link beyond it"
            )
        path.append(joint)
        link = joint.parent
    return [joint for joint in reversed(path) if joint.moves]


def _only_way(urdf: Urdf, start: str) -> list[UrdfJoint]:
    """All moving joints beyond `start`, where each has at most one successor."""
    path: list[UrdfJoint] = []
    link = start
    while True:
        following = list(_next_moving(urdf, link))
        if not following:
            return path
        if len(following) > 1:
            ends = [end for joint in following for end in _ends(urdf, joint)]
            candidates = ([joint.parent for joint in following] if path else []) + ends
            raise InputError(
                urdf.path,
                f"branches after {path[-1].name if path else start!r} into joints "
                f"{listed([joint.name for joint in following])}; choose the arm's last link with --tip: "
                f"{listed(list(dict.fromkeys(candidates)))}",
            )
        path.append(following[0])
        link = following[0].child


def _next_moving(urdf: Urdf, link: str) -> list[UrdfJoint]:
    found: list[UrdfJoint] = []
    for joint in urdf.children.get(link, []):
        found += [joint] if joint.moves else _next_moving(urdf, joint.child)
    return found


def _ends(urdf: Urdf, joint: UrdfJoint) -> list[str]:
    """Last moving links beyond `joint`."""
    following = _next_moving(urdf, joint.child)
    return [end for each in following for end in _ends(urdf, each)] if following else [joint.child]


def _require_independent(urdf: Urdf, joint: UrdfJoint, from_root: bool) -> None:
    if joint.mimics is not None:
        raise InputError(
            urdf.path,
            f"joint {joint.name!r} mimics {joint.mimics!r} and is not independent; "
            f"end the arm before it: --tip {joint.parent}",
        )
    if joint.kind in ("floating", "planar"):
        advice = f"start beyond it: --base {joint.child}" if from_root else f"choose another --base than {joint.parent}"
        raise InputError(urdf.path, f"joint {joint.name!r} is {joint.kind}, which acqd does not model; {advice}")


def _flange(urdf: Urdf, last: str) -> tuple[str, list[str]]:
    """The link for tools among those fixed to the last moving link."""
    leaves = [link for link in below(urdf, last) if not urdf.children.get(link)]
    named = [link for name in _TOOL_FRAMES for link in leaves if link.endswith(name)]
    if len(leaves) == 1:
        return leaves[0], []
    chosen = named[0] if named else last
    return chosen, [f"flange: {chosen}, of {listed(leaves)}; --tip chooses another"]


def listed(names: list[str]) -> str:
    """Names for a line of text; the first of them, and how many more there are."""
    more = f" and {len(names) - _MOST_CANDIDATES} more" if len(names) > _MOST_CANDIDATES else ""
    return ", ".join(names[:_MOST_CANDIDATES]) + more
