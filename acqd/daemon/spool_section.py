"""The section [spool] of acqd.toml: rows that are not delivered yet."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from acqd.section import Section
from acqd.telemetry.delivery import Until
from acqd.telemetry.spool import Limits, WhenFull


class SpoolSection(Section):
    """How long a row is kept, and what goes when the spool is full."""

    until: Until = "stored"
    max_mb: Annotated[float, Field(ge=1, le=10_000_000)] = 1_000.0
    max_age_days: Annotated[float, Field(gt=0, le=3_650)] = 30.0
    when_full: WhenFull = "drop-oldest"
    keep_minutes: Annotated[float, Field(ge=0, le=10_000)] = 10.0

    def limits(self) -> Limits:
        """The limits of the spool."""
        return Limits(
            int(self.max_mb * 1e6), self.max_age_days * 86_400.0, self.when_full, keep_s=self.keep_minutes * 60.0
        )
