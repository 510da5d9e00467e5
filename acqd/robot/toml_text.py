"""A robot description as TOML text, in the layout of the shipped files: one table per joint, short tables in one line.

The libraries that write TOML put every nested table under a separate heading.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from typing import Any

_LINE = 100  # characters


def description_text(table: Mapping[str, Any], comments: Sequence[str] = ()) -> str:
    """The text of a description's table; `comments` come first."""
    lines = [f"# {comment}" for comment in comments]
    lines += [f"{key} = {_value(value)}" for key, value in table.items() if key not in ("base", "joint", "flange")]
    sections = [("[base]", table["base"]), *(("[[joint]]", joint) for joint in table["joint"])]
    for heading, section in [*sections, ("[flange]", table["flange"])]:
        lines += ["", heading, *(f"{key} = {_value(value)}" for key, value in section.items() if value != [])]
    return "\n".join(lines) + "\n"


def _value(value: Any) -> str:
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{key} = {_value(each)}" for key, each in value.items()) + " }"
    if isinstance(value, Sequence):
        if value and isinstance(value[0], str):
            line = ", ".join(_value(each) for each in value)
            return f"[{line}]" if len(line) < _LINE else "[\n    " + line.replace('", "', '",\n    "') + ",\n]"
        return "[" + ", ".join(_value(each) for each in value) + "]"
    return f"{value:.9g}"
