"""Where an effect acts, with which parameters, and in which shape."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import TypeAlias

import numpy as np

from acqd.arrays import Floats
from acqd.models.greybox.parameters import SLIDING_UNITS

MOST_TIMES = 20.0
"""Change of a friction or loss, over the described one: grease at -20 degC is five to ten times as stiff."""
Shape: TypeAlias = Mapping[str, float]
"""Parameters that are not linear: a speed, a centre of mass, a joint number."""


@dataclass(frozen=True, slots=True)
class Parameter:
    """A linear parameter, fitted by regression."""

    name: str
    unit: str
    low: float = -np.inf
    """Physical lower bound."""
    high: float = np.inf
    """Physical upper bound."""
    deviation: float = np.inf
    """Standard deviation of the normal prior about 0; infinite without prior knowledge."""
    whole_low: float = -np.inf
    """Lower bound of the whole quantity, where the parameter is not a difference from a reference."""


@dataclass(frozen=True, slots=True)
class Place:
    """A place where an effect can act, and its parameters there."""

    where: str
    """`joint 2`, `all joints`, `cabinet` ..."""
    columns: tuple[int, ...]
    """Indices into the columns of `Effect.at`."""
    parameters: tuple[Parameter, ...]
    """One for every column, or for every column of `mix`."""
    mix: Floats | None = None
    """[columns, parameters]: fixed proportions in which a parameter acts on several columns."""


@dataclass(frozen=True, slots=True)
class Variant:
    """A hypothesis about an effect: a place and a shape."""

    place: Place
    columns: tuple[int, ...]
    """Indices into the effect's columns of all shapes side by side."""
    shape: Shape = field(default_factory=dict)

    @property
    def size(self) -> int:
        """Number of linear parameters."""
        return len(self.place.parameters)

    @property
    def precision(self) -> Floats:
        """[parameters] inverse variances of the normal priors; 0 without prior knowledge."""
        return np.array([each.deviation**-2.0 for each in self.place.parameters])

    def without_reference(self) -> Variant:
        """The variant whose parameters are whole quantities, not differences from a reference."""
        parameters = tuple(replace(each, low=max(each.low, each.whole_low)) for each in self.place.parameters)
        return replace(self, place=replace(self.place, parameters=parameters))


def per_joint(axes: int, like: Parameter, first: int = 0, nominal: Floats | None = None) -> Iterator[Place]:
    """Every joint by itself, all joints alike, and all joints with free parameters.

    `like`: the parameter of any joint; `first`: index of the first joint's column; `nominal` [axes]: the described
    values. With them, all joints change by the same share of the described value, a joint can lose no more than that
    value, and the prior deviation of a change is the value (where none is described, the mean of the others).
    """
    known = None if nominal is None else np.maximum(nominal, 0.0)
    own = [like if known is None else _of_described(like, k, known) for k in range(axes)]
    for k in range(axes):
        yield Place(f"joint {k + 1}", (first + k,), (own[k],))
    everywhere = tuple(range(first, first + axes))
    if known is None:
        yield Place("all joints", everywhere, (like,), np.ones((axes, 1)))
    elif known.any():
        even = bool((known == known[0]).all())
        common = own[0] if even else Parameter(f"{like.name}, relative", "-", -1.0, MOST_TIMES, 1.0)
        yield Place("all joints", everywhere, (common,), np.ones((axes, 1)) if even else known[:, None])
    free = tuple(replace(each, name=f"{like.name} joint {k + 1}") for k, each in enumerate(own))
    yield Place("each joint", everywhere, free)


def _of_described(like: Parameter, joint: int, known: Floats) -> Parameter:
    usual = known[joint] if known[joint] > 0 else known.mean()
    if usual <= 0:
        return replace(like, low=-float(known[joint]))
    return replace(
        like, low=-float(known[joint]), high=min(like.high, MOST_TIMES * float(usual)), deviation=float(usual)
    )


def in_units_of(place: Place, sliding: Collection[int]) -> Place:
    """The place with N and m in the units of prismatic joints `sliding` (from 0), where a parameter acts on them."""
    if not sliding:
        return place
    number = place.where.removeprefix("joint ")
    joints = [int(number) - 1 if number.isdigit() else _last_number(each.name) for each in place.parameters]
    pairs = zip(place.parameters, joints, strict=True)
    return replace(place, parameters=tuple(_sliding_unit(each, joint in sliding) for each, joint in pairs))


def _last_number(name: str) -> int:
    """Joint (from 0) at the end of a parameter's name, or -1."""
    last = name.rpartition("joint ")[2]
    return int(last) - 1 if last.isdigit() else -1


def _sliding_unit(parameter: Parameter, slides: bool) -> Parameter:
    return replace(parameter, unit=SLIDING_UNITS.get(parameter.unit, parameter.unit)) if slides else parameter
