"""`[homeassistant]` of acqd.toml."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from acqd.section import ARRAY, Section

_Prefix = Annotated[str, Field(pattern=r"^[A-Za-z0-9_-]+(/[A-Za-z0-9_-]+)*$")]


class HomeAssistantSection(Section):
    """Discovery messages for Home Assistant."""

    prefix: _Prefix = "homeassistant"
    expire_s: Annotated[int, Field(ge=0, le=86_400)] = 60
    """A value that is not renewed for so long becomes unavailable [s]; 0: never."""
    channels: Annotated[tuple[Literal["L1", "L2", "L3", "total"], ...], ARRAY] = ("L1", "L2", "L3", "total")


TABLES = {"homeassistant": HomeAssistantSection}
