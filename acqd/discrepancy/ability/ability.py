"""What recordings could tell: a certificate for people and for report.json."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import zip_longest
from typing import Any

from acqd.arrays import Floats
from acqd.discrepancy.ability.pairs import Rival, rivals_of
from acqd.discrepancy.ability.smallest import POWER, Smallest, smallest_sizes
from acqd.discrepancy.selection.ranking import Rows
from acqd.discrepancy.selection.spread import AS_IT_IS, More
from acqd.models.effects import library
from acqd.models.effects.effect import Effect
from acqd.report.digits import number

HELPS = {
    "rows": "more minutes, here and in the reference; for a constant load or a clock more sessions",
    "sessions": "recordings of another day, and more unchanged ones in the reference: these differ by nearly as much",
    "relevance": "nothing: smaller sizes do not matter",
    "bounds": "another motion: the size that would show exceeds what physics permits",
    "motion": "another motion: the effect never acts in this one",
}
"""What would make the smallest size smaller, by what limits it."""

_IN_WORDS, _RIVALS = 5, 3
"""Effects in a sentence, rivals in a cell."""


@dataclass(frozen=True, slots=True, eq=False)
class Ability:
    """What recordings show of every effect."""

    places: tuple[tuple[Smallest, tuple[Rival, ...]], ...]
    """Of every effect with one parameter, place by place and shape by shape, with its rivals."""
    unseen: tuple[tuple[str, str], ...]
    """Ids of effects without columns in these recordings, and why."""
    twice: tuple[float | None, ...] = ()
    """Per place the size with twice the minutes; empty where nobody asks, as in recordings that are made."""

    @classmethod
    def of(cls, rows: Rows, gate: Floats) -> Ability:
        """Of recordings under a gate [blocks]."""
        return cls.planned(rows, gate, 1.0, doubled=False)

    @classmethod
    def planned(
        cls, rows: Rows, gate: Floats, longer: float, *, doubled: bool = True, more: More = AS_IT_IS
    ) -> Ability:
        """Of recordings to come: `longer` times the minutes under the gate; `doubled`: also of twice as many."""
        effects = smallest_sizes(rows, gate, longer, more)
        places = tuple(zip(effects, rivals_of(rows, gate, effects, longer, more), strict=True))
        twice = tuple(each.size for each in smallest_sizes(rows, gate, 2 * longer)) if doubled else ()
        return cls(places, _unseen(rows, effects), twice)

    @property
    def easiest(self) -> dict[str, tuple[Smallest, tuple[Rival, ...]]]:
        """By id of the effect: the place and shape with the smallest power that can be told from nothing."""
        best: dict[str, tuple[Smallest, tuple[Rival, ...]]] = {}
        for place, rivals in self.places:
            if place.rms_W is None:
                continue
            known = best.get(place.candidate.id)
            if known is None or (known[0].rms_W or 0.0) > place.rms_W:
                best[place.candidate.id] = place, rivals
        return best

    def as_json(self) -> dict[str, Any]:
        """For report.json and `--json`."""
        return {
            "power": POWER,
            "effects": [
                _place_json(place, rivals) | ({"with_twice_the_minutes": twice} if self.twice else {})
                for (place, rivals), twice in zip_longest(self.places, self.twice)
            ],
            "not_judged": [{"id": name, "because": why} for name, why in self.unseen],
        }


def confused(place: Smallest, rivals: tuple[Rival, ...]) -> list[Rival]:
    """Rivals that an effect of the smallest size is not told apart from; without a size, none is asked."""
    return [each for each in rivals if place.size is not None and (each.size is None or each.size > place.size)]


def smallest_in_words(ability: Ability) -> str:
    """Effects that show best, with their smallest sizes; "" where no size can be stated."""
    places = sorted((place for place, _ in ability.easiest.values()), key=lambda place: place.rms_W or 0.0)
    return ", ".join(f"{each.candidate.id} {size_in_words(each)}" for each in places[:_IN_WORDS])


def size_in_words(place: Smallest) -> str:
    """The smallest size with its unit."""
    assert place.size is not None
    _, unit = place.parameter
    return f"{number(place.size)} {unit if unit != '-' else ''}".rstrip()


def table_of(ability: Ability) -> list[list[str]]:
    """A header, and a row per effect at its easiest place."""
    twice = {place.candidate.key: size for (place, _), size in zip(ability.places, ability.twice, strict=False)}
    more = ["twice the minutes"] if twice else []
    rows = [["effect", "where it shows best", "smallest", *more, "power [W RMS]", "limited by", "not told apart from"]]
    for name, (place, rivals) in ability.easiest.items():
        assert place.size is not None and place.rms_W is not None
        parameter, _ = place.parameter
        near = confused(place, rivals)
        others = [each.id if each.size is None else f"{each.id} below {number(each.size)}" for each in near[:_RIVALS]]
        if len(near) > _RIVALS:
            others.append(f"{len(near) - _RIVALS} more")
        rows.append(
            [
                name,
                place.candidate.label,
                f"{parameter} {size_in_words(place)}",
                *([number(size) if (size := twice[place.candidate.key]) is not None else "-"] if twice else []),
                number(place.rms_W),
                place.limited_by,
                ", ".join(others),
            ]
        )
    return rows


def _place_json(place: Smallest, rivals: tuple[Rival, ...]) -> dict[str, Any]:
    name, unit = place.parameter
    return {
        "id": place.candidate.id,
        "where": place.candidate.label,
        "shape": dict(place.shape),
        "parameter": name,
        "unit": unit,
        "smallest": place.size,
        "rms_W": place.rms_W,
        "limited_by": place.limited_by,
        "would_help": HELPS[place.limited_by],
        "rivals": [
            {"id": r.id, "where": r.where, "explains": r.explains, "told_apart_from": r.size}
            for r in confused(place, rivals)
        ],
    }


def _unseen(rows: Rows, effects: list[Smallest]) -> tuple[tuple[str, str], ...]:
    """Effects that were searched for and have no column of one parameter here."""
    judged = {each.candidate.id for each in effects}
    present = {each.id for each in rows.design.columns.candidates}
    return tuple(
        (name, "several parameters at each of its places" if name in present else _absent(rows, effect))
        for name, effect in library().items()
        if name in rows.design.columns.chosen and name not in judged
    )


def _absent(rows: Rows, effect: Effect) -> str:
    if effect.detected:
        return "its columns are detected in the residual, so that no size can be stated beforehand"
    if not all(effect.possible(scene) for scene in rows.design.columns.scenes):
        return f"the recordings lack {' and '.join(effect.needs)}"
    return "this robot or this question has no place for it"
