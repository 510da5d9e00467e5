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
    """The first layout whose joints come in one message, the names of its joints, and the messages that have all.

    Drivers put a prefix before all names of an arm. Where no name without a prefix fits, the only prefix that does is
    taken, unless the names are only numbers. Raises InputError where no topic fits, or several, or several arms.
    """
    for layout in layouts:
        bare = layout.joints or [joint.name for joint in robot.joint]
        some = {topic: states for topic, states in topics.items() if layout.topic in (None, topic)}
        own = {""} if any(_NUMBERED.fullmatch(name) for name in bare) else _prefixes(bare, some)
        for prefixes in ({""}, own):
            fitting = {prefix: found for prefix in sorted(prefixes) if (found := _complete(bare, prefix, some))}
            if len(fitting) > 1:
                raise InputError(path, _several_arms(bare, list(fitting)))
            for prefix, complete in fitting.items():
                if len(complete) > 1:
                    named = ", ".join(sorted(complete))
                    raise InputError(
                        path,
                        f"has states of the same joints in {named}: record one of them, or name it in the robot's "
                        f'description: [[log]] format = "ros", topic = "{min(complete, key=len)}"',
                    )
                return layout, [prefix + name for name in bare], complete.popitem()[1]
    raise InputError(path, _unfit(robot, layouts, topics))


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


def _several_arms(bare: list[str], prefixes: list[str]) -> str:
    """That the bag holds several arms of this kind, and how to choose one."""
    joints = ", ".join(f'"{prefixes[0]}{name}"' for name in bare)
    return (
        f"has several arms, whose joints begin with {', '.join(prefixes)}: choose one in the robot's description, "
        f'[[log]] format = "ros", joints = [{joints}]'
    )


def _unfit(robot: RobotDescription, layouts: list[LogColumns], topics: dict[str, States]) -> str:
    """Why no topic has the robot's joints, and what to do."""
    if all(layout.topic and layout.topic not in topics for layout in layouts):
        return f"has no joint states in {', '.join(str(layout.topic) for layout in layouts)}, but in {_listed(topics)}"
    names = layouts[0].joints or [joint.name for joint in robot.joint]
    found = sorted({name for states in topics.values() for _, state in states for name in state.name})
    advice = next(([prefix + name for name in names] for prefix in sorted(_prefixes(names, topics))), ["FIRST", "..."])
    if set(names) <= set(found):
        return (
            f"the joints of one arm come in several messages ({_listed(topics)}); expected all of {', '.join(names)} "
            "in each: record the topic of joint_state_broadcaster"
        )
    return (
        f"has the joints {', '.join(found)}; expected in one message {', '.join(names)}. If they are this robot's, "
        'write their names into its description, from the base on: [[log]] format = "ros", joints = ['
        + ", ".join(f'"{name}"' for name in advice)
        + "]"
    )


def _listed(topics: dict[str, States]) -> str:
    return ", ".join(sorted(topics))
