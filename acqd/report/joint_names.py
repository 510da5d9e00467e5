"""The robot's own names of joints in texts: the loop counts joints from 1, and a machine calls its second axis Y."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any, TypeVar

_NUMBERED = re.compile(r"\bjoint (\d+)\b")
_T = TypeVar("_T")


def with_joint_names(text: str, names: Sequence[str]) -> str:
    """The text with `joint 2` as `joint Y`; a name such as elbow_joint stands alone. Without names, as it is."""

    def named(found: re.Match[str]) -> str:
        number = int(found[1])
        if not 1 <= number <= len(names):
            return found[0]
        name = names[number - 1]
        return name if "joint" in name.lower() else f"joint {name}"

    return _NUMBERED.sub(named, text) if names else text


def all_with_joint_names(value: _T, names: Sequence[str]) -> _T:
    """The same in every text of a JSON value, for people to read; programs read the numbers."""
    shown: Any = value
    if isinstance(value, str):
        shown = with_joint_names(value, names)
    elif isinstance(value, dict):
        shown = {all_with_joint_names(key, names): all_with_joint_names(each, names) for key, each in value.items()}
    elif isinstance(value, list | tuple):
        shown = type(value)(all_with_joint_names(each, names) for each in value)
    result: _T = shown
    return result
