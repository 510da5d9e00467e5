"""A budget, as a table of TOML files has one."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from acqd.daemon.section import Positive
from acqd.section import Section


class Budget(Section):
    """Energy or cost that a day, a week or a month must not exceed."""

    per: Literal["day", "week", "month"]
    kWh: Positive | None = None
    EUR: Positive | None = None
    device: Annotated[str, Field(min_length=1)] | None = None
    """None: all devices together."""

    @model_validator(mode="after")
    def _one_limit(self) -> Budget:
        if (self.kWh is None) == (self.EUR is None):
            raise ValueError("a budget has either kWh or EUR")
        return self

    @property
    def limit(self) -> float:
        """In `unit`."""
        return self.kWh if self.kWh is not None else self.EUR or 0.0

    @property
    def unit(self) -> Literal["kWh", "EUR"]:
        """Of the limit."""
        return "EUR" if self.kWh is None else "kWh"
