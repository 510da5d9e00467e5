"""`[health]` of acqd.toml."""

from __future__ import annotations

import ipaddress
from typing import Annotated

from pydantic import Field, field_validator

from acqd.section import Section

_PortOrNone = Annotated[int, Field(ge=0, le=65_535)]


class HealthSection(Section):
    """Endpoints on a loopback port. They need no password, so they are for this computer only."""

    host: str = "127.0.0.1"
    port: _PortOrNone = 9731
    """Of the daemon; 0: none."""
    sink_port: _PortOrNone = 9732
    """Of the sink; 0: none."""

    @field_validator("host")
    @classmethod
    def _loopback(cls, host: str) -> str:
        try:
            loopback = ipaddress.ip_address(host).is_loopback
        except ValueError:
            loopback = False
        if not loopback:
            raise ValueError(
                "expected a loopback address like 127.0.0.1; a proxy with a password makes the endpoints public"
            )
        return host
