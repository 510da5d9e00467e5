"""The section `[quality]`: whether power quality is metered, and from which aggregation on there are rows."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

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
    signalling_threshold: Annotated[float, Field(ge=0.3, le=15)] | None = None
    """% of the declared voltage: 10/12-cycle rows of a recording begin above it, whatever `interval` says."""
    signalling_s: Annotated[float, Field(ge=1, le=120)] = 120.0
    """Length of a recording."""

    @model_validator(mode="after")
    def _carrier(self) -> QualitySection:
        if self.signalling_threshold is not None and self.signalling_hz is None:
            raise ValueError("signalling_threshold needs signalling_hz, the carrier")
        return self

    def options(self, responses: Responses = IDEAL) -> Options:
        """What is measured of each interval, behind transformers of these responses."""
        threshold = self.signalling_threshold
        return Options(
            interharmonic_groups=self.interharmonic_groups,
            signalling_Hz=self.signalling_hz,
            signalling_threshold=None if threshold is None else threshold / 100,
            signalling_s=self.signalling_s,
            harmonic_powers=self.harmonic_powers,
            lines=self.lines,
            bands=self.bands,
            responses=responses,
        )
