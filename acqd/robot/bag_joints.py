"""Which messages of a ROS bag are the states of the robot's joints: by the joints' names, with a prefix or without."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, TypeAlias

from acqd.errors import InputError
from acqd.robot.description import LogColumns, RobotDescription

_NUMBERED = re.compile(r"([a-z]*_)?(joint|axis|a|j)?_?\d+", re.IGNORECASE)
"""Names that many arms have: with a prefix, they are those of any robot."""
States: TypeAlias = list[tuple[int, Any]]
"""Messages sensor_msgs/JointState of a topic, each with the time of recording [ns]."""


def arm_states(
    path: Path, robot: RobotDescription, layouts: list[LogColumns], topics: dict[str, States]
) -> tuple[LogColumns, list[str], States]:
    """The first layout that fits one arm in one topic, the names of its joints, and the messages that have all.

    Layouts that name a topic are tried first.
    Drivers put a prefix before all names of an arm. Where no name without a prefix fits, the only prefix that does is
    taken, unless the names are only numbers. Raises InputError where no topic fits, or several, or several arms.
    """
    faults: list[str] = []
    for layout in sorted(layouts, key=lambda each: each.topic is None):  # stable: the most definite ones first
        bare = layout.joints or [joint.name for joint in robot.joint]
        some = {topic: states for topic, states in topics.items() if layout.topic in (None, topic)}
        own = {""} if any(_NUMBERED.fullmatch(name) for name in bare) else _prefixes(bare, some)
        for prefixes in ({""}, own):
            fitting = {prefix: found for prefix in sorted(prefixes) if (found := _complete(bare, prefix, some))}
            if not fitting:
                continue
            prefix, complete = next(iter(fitting.items()))
            if len(fitting) == len(complete) == 1:
                return layout, [prefix + name for name in bare], complete.popitem()[1]
            faults.append(_several(layout, bare, fitting))
            break
    raise InputError(path, faults[0] if faults else _unfit(robot, layouts, topics))


def _prefixes(bare: list[str], topics: dict[str, States]) -> set[str]:
    """What stands before the name of the first joint in any message."""
    present = {name for states in topics.values() for _, state in states for name in state.name}
    return {name.removesuffix(bare[0]) for name in present if name.endswith(bare[0])} - {""}


def _complete(bare: list[str], prefix: str, topics: dict[str, States]) -> dict[str, States]:
    """Of each topic that has any, the messages with a position for all joints."""
    wanted = {prefix + name for name in bare}
    found = {}
    for topic, states in topics.items():
        whole = [(ns, s) for ns, s in states if wanted <= set(s.name) and len(s.position) == len(s.name)]
        if whole:
            found[topic] = whole
    return found


def _several(layout: LogColumns, bare: list[str], fitting: dict[str, dict[str, States]]) -> str:
    """That the bag holds several arms of this kind, or one in several topics, and how to choose one.

    `fitting` are the topics of each prefix.
    """
    prefix, complete = next(iter(fitting.items()))
    topic = min(complete, key=len)
    keys = _keys([prefix + name for name in bare], topic, layout.effort)
    if len(fitting) > 1:
        return f"has several arms, whose joints begin with {', '.join(fitting)}: add to the robot's description {keys}"
    return (
        f"has states of the same joints in {_listed(complete)}: record one of them, or add to the robot's description "
        f"{keys}"
    )


def _keys(names: list[str], topic: str | None = None, effort: str = "tau") -> str:
    """The layout to write into a description."""
    joints = ", ".join(f'"{name}"' for name in names)
    keys = [f'topic = "{topic}"'] if topic else []
    keys += [f"joints = [{joints}]"] + ([f'effort = "{effort}"'] if effort != "tau" else [])
    return f'[[log]] format = "ros", {", ".join(keys)}'


def _unfit(robot: RobotDescription, layouts: list[LogColumns], topics: dict[str, States]) -> str:
    """Why no topic has the robot's joints, and what to do."""
    if all(layout.topic and layout.topic not in topics for layout in layouts):
        return f"has no joint states in {', '.join(str(layout.topic) for layout in layouts)}, but in {_listed(topics)}"
    names = layouts[0].joints or [joint.name for joint in robot.joint]
    found = sorted({name for states in topics.values() for _, state in states for name in state.name})
    known = ([prefix + name for name in names] for prefix in sorted(_prefixes(names, topics)))
    advice = next((each for each in known if set(each) <= set(found)), ["FIRST", "..."])
    if set(names) <= set(found):
        return (
            f"the joints of one arm come in several messages ({_listed(topics)}); expected all of {', '.join(names)} "
            "in each: record the topic of joint_state_broadcaster"
        )
    return (
        f"has the joints {', '.join(found)}; expected in one message {', '.join(names)}. If they are this robot's, "
        f"write their names into its description, from the base on: {_keys(advice, effort=layouts[0].effort)}"
    )


def _listed(topics: dict[str, States]) -> str:
    return ", ".join(sorted(topics))
