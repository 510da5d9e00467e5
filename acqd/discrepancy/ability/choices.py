"""Which further column, or whether more minutes, would help most: the same certificate, with and without it.

A pair is an effect beside nothing or beside another effect, at the smallest size that shows: that of the plan, or of
the choice where that is larger. Choices are sorted by how much smaller the sizes become; what tells more pairs apart,
or shows further effects, is said beside the table.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from acqd.discrepancy.ability.ability import Ability, size_in_words
from acqd.discrepancy.ability.pairs import Rival
from acqd.discrepancy.ability.smallest import Smallest

_SLACK = 1 + 1e-9
_WORTH_SAYING = 0.95
"""Median size relative to the plan from which on a sentence says so."""
_Places = dict[str, tuple[Smallest, tuple[Rival, ...]]]


@dataclass(frozen=True, slots=True)
class Choice:
    """What a further column, or more minutes, would change."""

    name: str
    assumed: str
    """About the column, which nobody has recorded; "" for nothing."""
    effects: int
    """That have a smallest size."""
    apart: int
    """Pairs that are told apart with a probability of 95 %."""
    pairs: int
    shrinks: float
    """Median smallest size, of the effects that the choice may show, relative to that of the plan."""
    gains_most: str
    """The effect with the greatest change, in words; "" for none."""

    @property
    def worth(self) -> tuple[int, float]:
        """For a comparison: the larger, the better."""
        return self.apart, -self.shrinks

    def as_json(self) -> dict[str, Any]:
        """For `--json`."""
        return {
            "choice": self.name, "assumed": self.assumed, "effects_with_a_size": self.effects,
            "pairs_told_apart": self.apart, "pairs": self.pairs, "median_size": self.shrinks,
            "gains_most": self.gains_most,
        }  # fmt: skip


def choice(
    name: str, assumed: str, plan: Ability, other: Ability, counted: Iterable[str], shown: Iterable[str] | None = None
) -> Choice:
    """A choice beside the plan; `counted`: ids of effects that are compared, of those that have a size.

    `shown`: those of them that the choice may show (None: all), because no torque makes a load in the cabinet smaller.
    """
    wanted, planned = set(counted), plan.easiest
    sized = wanted if shown is None else wanted & set(shown)
    new = {key: value for key, value in other.easiest.items() if key not in planned and key in wanted}
    places = {key: value for key, value in planned.items() if key in wanted} | new
    known: _Places = {place.candidate.key: (place, rivals) for place, rivals in other.places}
    apart = sum(_apart(place, known, set(places)) for place, _ in places.values())
    shrinks = {
        key: size / place.size
        for key, (place, _) in places.items()
        if key in planned and key in sized and place.size and (size := _size(known, place)) is not None
    }
    return Choice(
        name, assumed, len(places), apart, len(places) ** 2, float(np.median(list(shrinks.values()) or [1.0])),
        _gains_most(places, known, new, shrinks),
    )  # fmt: skip


def _size(known: _Places, place: Smallest) -> float | None:
    return known[place.candidate.key][0].size if place.candidate.key in known else None


def _apart(place: Smallest, known: _Places, names: set[str]) -> int:
    """Effects, and nothing, that an effect of the smallest size is told apart from."""
    size = _size(known, place)
    if size is None or place.size is None:
        return 0
    least = {each.id: each.size for each in known[place.candidate.key][1]}
    others = [least.get(name, size) for name in names - {place.candidate.id}]
    return 1 + sum(other is not None and other <= _SLACK * max(size, place.size) for other in others)


def _gains_most(places: _Places, known: _Places, new: _Places, shrinks: dict[str, float]) -> str:
    """A new effect with its size, or the effect whose size shrinks most."""
    if new:
        return ", ".join(f"{name} {size_in_words(place)}" for name, (place, _) in new.items())
    best = min(shrinks, key=lambda name: shrinks[name], default="")
    if not best or shrinks[best] > 0.99:
        return ""
    place = places[best][0]
    return f"{best} {size_in_words(known[place.candidate.key][0])} instead of {size_in_words(place)}"


def most_helpful(choices: Iterable[Choice]) -> list[str]:
    """What makes sizes smallest, tells most pairs apart, and shows further effects; the first choice is the plan."""
    plan, *others = choices
    said = []
    smaller = min(others, key=lambda each: each.shrinks, default=plan)
    if smaller.shrinks < _WORTH_SAYING:
        said.append(f"Sizes shrink most by {smaller.name}: to {smaller.shrinks:.2f} times those of the plan.")
    same = [each for each in others if each.effects == plan.effects]
    apart = max(same, key=lambda each: each.worth, default=plan)
    if apart.apart > plan.apart:
        said.append(f"Most pairs are told apart by {apart.name}: {apart.apart} of {apart.pairs} beside {plan.apart}.")
    more = [f"{each.name} ({each.gains_most})" for each in others if each.effects > plan.effects]
    if more:
        said.append(f"Further effects show with {'; '.join(more)}.")
    return said or ["Neither more minutes nor a further column would tell more."]


def choices_table(choices: Iterable[Choice]) -> list[list[str]]:
    """A header, and a row per choice: the plan, then those with the smallest sizes first."""
    plan, *others = choices
    header = ["choice", "effects", "pairs told apart", "sizes, times", "gains most"]
    rows = [
        [each.name, str(each.effects), f"{each.apart} of {each.pairs}", f"{each.shrinks:.2f}", each.gains_most]
        for each in [plan, *sorted(others, key=lambda each: each.shrinks)]
    ]
    return [header, *rows]


def assumptions(choices: Iterable[Choice]) -> list[str]:
    """What is assumed of columns that nobody has recorded, a sentence per assumption."""
    by_text: dict[str, list[str]] = {}
    for each in choices:
        if each.assumed:
            by_text.setdefault(each.assumed, []).append(each.name)
    return [f"Assumed for {' and '.join(names)}: {text}." for text, names in by_text.items()]
