"""`[energy]` of acqd.toml: the tariff of everything that shows a cost."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from acqd.section import FileName, Section


class EnergySection(Section):
    """What a kWh costs, and where a day begins."""

    must_exist = ("tariff",)

    tariff: FileName | None = None
    """TOML file with prices (docs/energy.md), next to acqd.toml if the path is relative; None: kWh, no cost."""
    zone: Annotated[str, Field(min_length=1)] | None = None
    """Zone of local time; None: the tariff's, else that of this computer."""
