"""What the loop has said about a hidden change, beside the truth."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from acqd.lab.trial.hidden import Hidden

Answer = Literal["right", "place", "rival", "wrong", "open", "nothing"]
"""Named, where a joint matters at the right one; named at another place; named as the closest rival or a member of
the family; another name; no name, but something differs; nothing was seen."""
IN_WORDS: dict[Answer, str] = {
    "right": "The loop has named the hidden change.",
    "place": "The loop has named the kind of the hidden change, at another place.",
    "rival": "The loop has named another cause first, and the hidden change as an alternative.",
    "wrong": "The loop has named another cause.",
    "open": "The loop has seen that something differs, and gives no name.",
    "nothing": "The loop has seen no change.",
}


@dataclass(frozen=True, slots=True)
class Size:
    """A size that the loop gives for the hidden quantity."""

    value: float
    unit: str
    ci95: tuple[float, float] | None

    def holds(self, truth: float) -> bool | None:
        """Whether the interval holds the truth; None without an interval."""
        return None if self.ci95 is None else self.ci95[0] <= truth <= self.ci95[1]


@dataclass(frozen=True, slots=True)
class Outcome:
    """The comparison."""

    answer: Answer
    named: tuple[tuple[str, str, float], ...]
    """Id, place and confidence of every named effect."""
    size: Size | None
    """Where the loop gives the quantity that was hidden."""


def outcome(hidden: Hidden, report: Mapping[str, Any]) -> Outcome:
    """Compare with report.json."""
    effects = report["effects"]
    named = tuple((each["id"], each["where"], each["confidence"]) for each in effects)
    match = next((each for each in effects if each["id"] == hidden.change.id), None)
    return Outcome(_answer(hidden, report, match), named, None if match is None else _size(hidden, match))


def _answer(hidden: Hidden, report: Mapping[str, Any], match: Mapping[str, Any] | None) -> Answer:
    if match is not None:
        return "right" if _at(hidden, match) else "place"
    if not report["effects"]:
        return "nothing" if report["verdict"] == "nothing_left" else "open"
    others = [other["id"] for each in report["effects"] for other in [*each["rivals"][:1], *each["family"]["members"]]]
    return "rival" if hidden.change.id in others else "wrong"


def _at(hidden: Hidden, effect: Mapping[str, Any]) -> bool:
    """Whether the place is that of the change; an effect of all joints has a size for the joint in question."""
    place = re.compile(rf"\b{hidden.where}\b")
    if not hidden.axis or place.search(effect["where"]):
        return True
    own = [name for name in effect["parameters"] if place.search(name)]
    return "each joint" in effect["where"] and bool(own) and own[0] == _clearest(effect)


def _clearest(effect: Mapping[str, Any]) -> str:
    def clear(name: str) -> float:
        parameter = effect["parameters"][name]
        low, high = parameter["ci95"] or (0.0, float("inf"))
        return float(abs(parameter["value"]) / max((high - low) / 2, 1e-12))

    return str(max(effect["parameters"], key=clear))


def _size(hidden: Hidden, effect: Mapping[str, Any]) -> Size | None:
    """The quantity that was hidden, if the loop gives that."""
    parameter = effect["parameters"].get(hidden.change.named)
    if parameter is None:
        return None
    bounds = parameter["ci95"]
    return Size(parameter["value"], parameter["unit"], None if bounds is None else (bounds[0], bounds[1]))
