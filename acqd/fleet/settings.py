"""What holds for a whole fleet."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field, field_validator

from acqd.fleet.robot import FleetRobot
from acqd.models.effects import library
from acqd.robot.section import Section

_Hours = Annotated[float, Field(gt=0)]


class FleetSettings(Section):
    """The table [fleet]."""

    false_discoveries: Annotated[float, Field(gt=0, lt=0.5)] = 0.05
    """Expected share of unchanged robots among those that are called changed."""
    method: Literal["benjamini-hochberg", "benjamini-yekutieli"] = "benjamini-hochberg"
    """The second holds under any dependence between robots, and finds less."""
    shared_chance: Annotated[float, Field(gt=0, lt=0.5)] = 0.01
    """Probability that causes which occur by themselves are called shared."""
    shared_hours: list[_Hours] = Field(default=[1.0, 8.0, 24.0, 168.0])
    """Lengths of the windows of time in which onsets are counted."""
    base_rates: dict[str, Annotated[float, Field(gt=0)]] = Field(default={})
    """How much more often than others a cause occurs by itself; default 1 for every effect of the library."""
    max_effects: Annotated[int, Field(ge=1, le=24)] = 3
    """Largest number of causes per robot."""
    only: list[str] = Field(default=[])
    """Effects that compete as causes; empty: all."""
    seed: Annotated[int, Field(ge=0)] = 1

    @field_validator("base_rates", "only")
    @classmethod
    def _known(cls, names: Collection[str]) -> Collection[str]:
        unknown = sorted(set(names) - set(library()))
        if unknown:
            raise ValueError(f"no effect {unknown[0]!r}; the effects are {', '.join(library())}")
        return names


@dataclass(frozen=True, slots=True)
class Fleet:
    """A fleet as its file describes it."""

    path: Path
    robots: tuple[FleetRobot, ...]
    settings: FleetSettings
