"""Which effects there are, and how they are ordered."""

from __future__ import annotations

import difflib
import importlib
import inspect
import pkgutil
import zlib
from collections.abc import Sequence
from functools import cache
from importlib.metadata import entry_points
from typing import Annotated

import numpy as np
from pydantic import Field, ValidationError, model_validator

from acqd.errors import UserError
from acqd.lab.plant.situation import Effect
from acqd.robot.description import Section


class EffectSpec(Section):
    """One effect to switch on."""

    id: str
    values: dict[str, float] = Field(default={})
    recording: Annotated[int, Field(ge=1, le=1_000_000)] = 1
    """Number of the recording in which it begins."""
    at_s: Annotated[float, Field(ge=0)] = 0.0
    """Seconds after that recording's begin."""
    declared: bool = True
    """Whether the campaign's public manifest mentions it."""

    @model_validator(mode="after")
    def _possible(self) -> EffectSpec:
        known = known_effects()
        if self.id not in known:
            near = difflib.get_close_matches(self.id, known, n=1, cutoff=0.4)
            hint = f"did you mean {near[0]}?" if near else f"known: {', '.join(known)}"
            raise ValueError(f"effect {self.id!r} is unknown; {hint}")
        effect = known[self.id]
        for name, value in self.values.items():
            if name not in effect.defaults:
                allowed = "=, ".join([*effect.defaults, "from", "at"])
                raise ValueError(f"effect {self.id}: '{name}' is not one of {allowed}=")
            least, greatest = effect.limits.get(name, (-1e6, 1e6))
            if not least <= value <= greatest:
                raise ValueError(f"effect {self.id}: {name}={value:g} is outside {least:g} .. {greatest:g}")
        if effect.whole_recordings and self.at_s > 0:
            raise ValueError(f"effect {self.id}: at={self.at_s:g}: it can only begin with a recording (from=)")
        return self


@cache
def known_effects() -> dict[str, type[Effect]]:
    """All effects by id."""
    package = importlib.import_module(__package__)
    found: list[type[Effect]] = []
    for module_info in pkgutil.iter_modules(package.__path__):
        module = importlib.import_module(f"{__package__}.{module_info.name}")
        classes = inspect.getmembers(module, inspect.isclass)
        found += [
            cls
            for _, cls in classes
            if issubclass(cls, Effect) and cls.__module__ == module.__name__ and hasattr(cls, "id")
        ]
    found += [entry.load() for entry in entry_points(group="acqd.lab.effects")]
    return {cls.id: cls for cls in sorted(found, key=lambda cls: cls.id)}


def parse_effect(text: str, *, declared: bool = True) -> EffectSpec:
    """`payload:mass_kg=1.5,from=20,at=3.5` as an order. Raises UserError."""
    name, _, rest = (part.strip() for part in text.partition(":"))
    values: dict[str, float] = {}
    for item in filter(None, (part.strip() for part in rest.split(","))):
        key, equals, number = (part.strip() for part in item.partition("="))
        try:
            values[key] = float(number)
        except ValueError:
            raise UserError(f"effect {name}: {item!r} is not like name=1.5{'' if equals else ' (no =)'}") from None
        if not np.isfinite(values[key]):
            raise UserError(f"effect {name}: {item} is no finite number")
    begin, at = values.pop("from", 1.0), values.pop("at", 0.0)
    if not 1 <= begin <= 1e6 or begin != int(begin) or at < 0:
        raise UserError(f"effect {name}: from={begin:g},at={at:g}: expected a recording number from 1 and seconds >= 0")
    try:
        return EffectSpec(id=name, values=values, recording=int(begin), at_s=at, declared=declared)
    except ValidationError as error:
        raise UserError(error.errors()[0]["msg"].removeprefix("Value error, ")) from None


def check_axes(orders: Sequence[EffectSpec], axes: int) -> None:
    """Raises UserError for an effect on an axis that the robot does not have."""
    for order in orders:
        axis = order.values.get("axis", 0)
        if axis != int(axis) or axis > axes:
            raise UserError(f"effect {order.id}: axis={axis:g}, but the robot has the axes 1 to {axes}")


def make_effects(orders: Sequence[EffectSpec], seed: Sequence[int]) -> list[Effect]:
    """Fresh effects for one session; each has random numbers of its own."""
    known = known_effects()
    effects = []
    for place, order in enumerate(orders):
        random = np.random.default_rng([*seed, place, zlib.crc32(order.id.encode())])
        effects.append(known[order.id](order.values, (order.recording, order.at_s), random))
    return effects
