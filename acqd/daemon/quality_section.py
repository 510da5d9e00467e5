"""The section `[quality]`: whether power quality is metered, and from which aggregation on there are rows."""

from __future__ import annotations

from typing import Literal

from acqd.daemon.section import Section

BridgedQuality = Literal["10/12", "150/180", "10min", "off"]
"""Setting of a bridge: the rows of power quality that it passes on, from this aggregation on."""


class QualitySection(Section):
    """Power quality, in addition to the windows."""

    enabled: bool = False
    interval: Literal["10/12", "150/180", "10min"] = "10/12"
    """The shortest aggregation with rows; the longer ones always have them."""
