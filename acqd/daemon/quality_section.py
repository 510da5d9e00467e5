"""The section `[quality]`: whether power quality is metered, and from which aggregation on there are rows."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from acqd.metering.quality.quantities import Options
from acqd.metering.quality.response import IDEAL, Responses
from acqd.section import Section

BridgedQuality = Literal["10/12", "150/180", "10min", "off"]
"""Setting of a bridge: the rows of power quality that it passes on, from this aggregation on."""


class QualitySection(Section):
    """Power quality, in addition to the windows."""

    enabled: bool = False
    interval: Literal["10/12", "150/180", "10min"] = "10/12"
    """The shortest aggregation with rows; the longer ones always have them."""
    flicker: bool = False
    interharmonic_groups: bool = False
    harmonic_powers: bool = False
    lines: bool = False
    bands: bool = False
    signalling_hz: Annotated[float, Field(ge=110, le=2_450)] | None = None
    """Carrier of mains signalling."""

    def options(self, responses: Responses = IDEAL) -> Options:
        """What is measured of each interval, behind transformers of these responses."""
        return Options(
            self.interharmonic_groups, self.signalling_hz, self.harmonic_powers, self.lines, self.bands, responses
        )
