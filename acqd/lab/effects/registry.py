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
from pydantic import Field

from acqd.errors import UserError
from acqd.lab.plant.situation import Effect
from acqd.robot.description import Section


class EffectOrder(Section):
    """One effect to switch on."""

    id: str
    values: dict[str, float] = Field(default={})
    recording: Annotated[int, Field(ge=1)] = 1
    """Number of the recording in which it begins."""
    at_s: Annotated[float, Field(ge=0)] = 0.0
    """Seconds after that recording's begin."""
    declared: bool = True
    """Whether the campaign's public manifest mentions it."""


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


def parse_effect(text: str, *, declared: bool = True) -> EffectOrder:
    """`payload:mass_kg=1.5,from=20,at=3.5` as an order. Raises UserError."""
    name, _, rest = text.partition(":")
    name = name.strip()
    known = known_effects()
    if name not in known:
        near = difflib.get_close_matches(name, known, n=1, cutoff=0.4)
        hint = f"did you mean {near[0]}?" if near else f"known: {', '.join(known)}"
        raise UserError(f"effect {name!r} is unknown; {hint}")
    values: dict[str, float] = {}
    for item in filter(None, (part.strip() for part in rest.split(","))):
        key, equals, number = item.partition("=")
        allowed = [*known[name].defaults, "from", "at"]
        if not equals or key not in allowed:
            raise UserError(f"effect {name}: {item!r} is not one of {'=, '.join(allowed)}=")
        try:
            values[key] = float(number)
        except ValueError:
            raise UserError(f"effect {name}: {key}={number!r} is no number") from None
        if not np.isfinite(values[key]):
            raise UserError(f"effect {name}: {key}={number} is no finite number")
    begin, at = values.pop("from", 1.0), values.pop("at", 0.0)
    if begin < 1 or begin != int(begin) or at < 0:
        raise UserError(f"effect {name}: from={begin:g},at={at:g}: expected a recording number from 1 and seconds >= 0")
    return EffectOrder(id=name, values=values, recording=int(begin), at_s=at, declared=declared)


def make_effects(orders: Sequence[EffectOrder], seed: Sequence[int]) -> list[Effect]:
    """Fresh effects for one session; each has random numbers of its own. Raises UserError."""
    known = known_effects()
    effects = []
    for order in orders:
        random = np.random.default_rng([*seed, zlib.crc32(order.id.encode())])
        effects.append(known[order.id](order.values, (order.recording, order.at_s), random))
    return effects
