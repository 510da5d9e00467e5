"""`[plain]` of acqd.toml."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from acqd.daemon.quality_section import BridgedQuality
from acqd.section import Section


class PlainSection(Section):
    """Numbers of `acqd bridge plain`."""

    prefix: Annotated[str, Field(pattern=r"^[^/+#\s]+(/[^/+#\s]+)*$")] = "acqd"
    every_row: bool = False
    """Of every row instead of the 1 s summaries."""
    quality: BridgedQuality = "150/180"
    """Rows of power quality from this aggregation on: some 800 numbers per interval of three phases."""


TABLES = {"plain": PlainSection}
