"""Where an effect acts, with which parameters, and in which shape."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import TypeAlias

import numpy as np

from acqd.arrays import Floats
from acqd.models.greybox.parameters import SLIDING_UNITS

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


def per_joint(
    axes: int, name: str, unit: str, nominal: Floats | None = None, first: int = 0, low: float | Floats = -np.inf
) -> Iterator[Place]:
    """Every joint by itself, all joints in the proportions of `nominal` [axes], and all joints with free parameters.

    `first`: index of the first joint's column; `low`: lower bound, of all joints or [axes].
    """
    least = np.broadcast_to(low, axes).tolist()
    for k in range(axes):
        yield Place(f"joint {k + 1}", (first + k,), (Parameter(name, unit, least[k]),))
    everywhere = tuple(range(first, first + axes))
    if nominal is not None and nominal.any():
        even = bool((nominal == nominal[0]).all())
        common = Parameter(name, unit, max(least)) if even else Parameter(f"{name}, relative", "-", -1.0)
        yield Place("all joints", everywhere, (common,), (nominal / (nominal[0] if even else 1.0))[:, None])
    yield Place(
        "each joint", everywhere, tuple(Parameter(f"{name} joint {k + 1}", unit, least[k]) for k in range(axes))
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
