"""The parameter that stands for the size of a cause, where a table has room for one."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any


def main_parameter(parameters: Mapping[str, Mapping[str, Any]]) -> str | None:
    """The name of the largest value in the unit of the first one; None of a cause without parameters.

    A peak has its power in several steps after the brakes open, of which the first is the least certain.
    """
    if not parameters:
        return None
    unit = next(iter(parameters.values()))["unit"]
    alike = [name for name, parameter in parameters.items() if parameter["unit"] == unit]
    return max(alike, key=lambda name: abs(float(parameters[name]["value"])))
