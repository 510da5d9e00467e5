"""The size of an effect that differs most clearly from zero: of seven joints one may have changed."""

from __future__ import annotations

import re
from typing import Any

from acqd.discrepancy.repair.terms import Reported

_JOINT = re.compile(r"joint \d+$")


def main_parameter(each: Reported) -> tuple[str, dict[str, Any]]:
    """Name and value of the parameter; a fitted shape is no size."""
    parameters = each.term.parameters
    own = {name: value for name, value in parameters.items() if name not in each.term.shape} or parameters
    return max(own.items(), key=lambda named: _clear(named[1]))


def changed_place(each: Reported) -> str:
    """Place of the effect; of an effect with one size for each joint, the joint that has changed."""
    joint = _JOINT.search(main_parameter(each)[0]) if each.term.where == "each joint" else None
    return joint.group() if joint else each.term.where


def _clear(parameter: dict[str, Any]) -> float:
    """Value over half width of its interval; 0 without an interval."""
    bounds = parameter["ci95"]
    return abs(parameter["value"]) / max((bounds[1] - bounds[0]) / 2, 1e-12) if bounds else 0.0
