"""The registry of effects, and the specification of an effect in settings and options."""

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

from acqd.errors import UserError, in_our_words
from acqd.lab.plant.situation import Effect
from acqd.robot.description import Section


class EffectSpec(Section):
    """One effect to switch on: its parameters and its onset."""

    id: str
    values: dict[str, float] = Field(default={})
    recording: Annotated[int, Field(ge=1, le=1_000_000)] = 1
    """Number of the recording in which it starts."""
    at_s: Annotated[float, Field(ge=0)] = 0.0
    """Seconds after the start of that recording."""
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
            raise ValueError(f"effect {self.id}: at={self.at_s:g}: it can only start with a recording (from=)")
        return self


@cache
def known_effects() -> dict[str, type[Effect]]:
    """All effects by id, of this package and of entry points."""
    package = importlib.import_module(__package__)
    effects: list[type[Effect]] = []
    for module_info in pkgutil.iter_modules(package.__path__):
        module = importlib.import_module(f"{__package__}.{module_info.name}")
        classes = inspect.getmembers(module, inspect.isclass)
        effects += [
            cls
            for _, cls in classes
            if issubclass(cls, Effect) and cls.__module__ == module.__name__ and hasattr(cls, "id")
        ]
    effects += [entry.load() for entry in entry_points(group="acqd.lab.effects")]
    return {cls.id: cls for cls in sorted(effects, key=lambda cls: cls.id)}


def parse_effect(text: str, *, declared: bool = True) -> EffectSpec:
    """Parse an option such as `payload:mass_kg=1.5,from=20,at=3.5`. Raises UserError."""
    name, _, rest = (part.strip() for part in text.partition(":"))
    values: dict[str, float] = {}
    for item in filter(None, (part.strip() for part in rest.split(","))):
        key, equals, number = (part.strip() for part in item.partition("="))
        try:
            values[key] = float(number)
        except ValueError:
            raise UserError(f"effect {name}: {item!r} is not like name=1.5{'' if equals else ' (no =)'}") from None
        if not np.isfinite(values[key]):
            raise UserError(f"effect {name}: {item} is not a finite number")
    recording, at_s = values.pop("from", 1.0), values.pop("at", 0.0)
    if not 1 <= recording <= 1e6 or recording != int(recording) or at_s < 0:
        raise UserError(
            f"effect {name}: from={recording:g},at={at_s:g}: expected a recording number from 1 and seconds >= 0"
        )
    try:
        return EffectSpec(id=name, values=values, recording=int(recording), at_s=at_s, declared=declared)
    except ValidationError as error:
        raise UserError(in_our_words(error.errors()[0]["msg"])) from None


def check_axes(specs: Sequence[EffectSpec], axes: int) -> None:
    """Raise UserError for an effect on an axis that the robot does not have."""
    for spec in specs:
        axis = spec.values.get("axis", 0)
        if axis != int(axis) or axis > axes:
            raise UserError(f"effect {spec.id}: axis={axis:g}, but the robot has the axes 1 to {axes}")


def make_effects(specs: Sequence[EffectSpec], seed: Sequence[int]) -> list[Effect]:
    """New effects for one session, with independent random numbers."""
    known = known_effects()
    effects = []
    for number, spec in enumerate(specs):
        random = np.random.default_rng([*seed, number, zlib.crc32(spec.id.encode())])
        effects.append(known[spec.id](spec.values, (spec.recording, spec.at_s), random))
    return effects
