"""`[[source]]` of acqd.toml: one of several boxes of a daemon, with the device of its rows."""

from __future__ import annotations

from pydantic import Field, model_validator

from acqd.daemon.modbus_sections import MetersSection
from acqd.daemon.source_sections import SourceSection
from acqd.section import Section
from acqd.telemetry.topics import valid_device


class BoxSection(Section):
    """A source and the device of its rows; each meter has a name."""

    device: str | None = None
    source: SourceSection = Field(discriminator="kind")

    @model_validator(mode="after")
    def _has_a_name(self) -> BoxSection:
        meters = isinstance(self.source, MetersSection)
        if meters and self.device is not None:
            raise ValueError("device: the rows of meters have the names of the meters; delete it")
        if not meters and self.device is None:
            raise ValueError("device is missing: with several sources, each one needs a name for its rows")
        if self.device is not None and not valid_device(self.device):
            raise ValueError(f"device {self.device!r:.70}: expected 1 to 64 letters, digits, dots, dashes, underscores")
        return self

    @property
    def devices(self) -> list[str]:
        """Devices of its rows."""
        if isinstance(self.source, MetersSection):
            return [meter.name for meter in self.source.meters]
        return [self.device or ""]
