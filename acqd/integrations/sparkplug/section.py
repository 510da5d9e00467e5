"""`[sparkplug]` of acqd.toml."""

from __future__ import annotations

import socket
from typing import Annotated

from pydantic import Field

from acqd.daemon.quality_section import BridgedQuality
from acqd.daemon.section import Positive
from acqd.section import Section

_Name = Annotated[str, Field(pattern=r"^[^/+#\s]{1,64}$")]


class SparkplugSection(Section):
    """The edge node of `acqd bridge sparkplug`."""

    group: _Name = "acqd"
    node: _Name = Field(default_factory=socket.gethostname)
    stale_s: Positive = 60.0
    """A device without summaries for so long is declared dead [s]."""
    quality: BridgedQuality = "150/180"
    """Rows of power quality from this aggregation on: some 800 metrics per interval of three phases."""


TABLES = {"sparkplug": SparkplugSection}
