"""`[influx]` of acqd.toml."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from acqd.daemon.quality_section import BridgedQuality
from acqd.section import Section


class InfluxSection(Section):
    """Where `acqd bridge influx` writes rows."""

    url: Annotated[str, Field(pattern=r"^https?://")] = "http://127.0.0.1:8086/write?db=acqd&precision=ns"
    token: str | None = Field(default=None, repr=False)
    measurement: Annotated[str, Field(pattern=r"^[A-Za-z0-9_.-]+$")] = "power"
    waiting: Annotated[int, Field(ge=1_000, le=10_000_000)] = 200_000
    """Rows that are kept in memory while the server is away."""
    quality: BridgedQuality = "10/12"
    """Rows of power quality from this aggregation on."""


TABLES = {"influx": InfluxSection}
