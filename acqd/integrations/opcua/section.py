"""`[opcua]` of acqd.toml."""

from __future__ import annotations

from pydantic import Field, model_validator

from acqd.daemon.quality_section import BridgedQuality
from acqd.daemon.section import Host, Port, Positive
from acqd.section import FileName, Section
from acqd.telemetry.mqtt import is_loopback


class OpcUaSection(Section):
    """The OPC UA server of `acqd opcua`."""

    must_exist = ("certificate", "key")

    host: Host = "127.0.0.1"
    port: Port = 4840
    certificate: FileName | None = None
    """With `key`: connections are signed and encrypted (Basic256Sha256)."""
    key: FileName | None = None
    username: str | None = None
    password: str | None = Field(default=None, repr=False)
    stale_s: Positive = 5.0
    """Values without a new row for so long, and for five intervals, are bad [s]."""
    quality: BridgedQuality = "150/180"
    """Rows of power quality from this aggregation on."""

    @model_validator(mode="after")
    def _closed_to_strangers(self) -> OpcUaSection:
        if (self.certificate is None) != (self.key is None):
            raise ValueError("certificate and key belong together: set both or none")
        if (self.username is None) != (self.password is None):
            raise ValueError("username and password belong together: set both or none")
        if not is_loopback(self.host) and (self.certificate is None or self.username is None):
            raise ValueError("off loopback, certificate, key, username and password are needed")
        return self


TABLES = {"opcua": OpcUaSection}
