"""The feed of a configuration: metered samples, or meters that are read."""

from __future__ import annotations

from acqd.daemon.config import Config
from acqd.daemon.feed import Deliver, Feed
from acqd.daemon.meter_feed import MeterFeed
from acqd.daemon.modbus_sections import MetersSection
from acqd.daemon.waveform_feed import WaveformFeed
from acqd.telemetry.spool import Energy


def devices_of(config: Config) -> list[str]:
    """Devices of the rows of this configuration."""
    source = config.source
    return [meter.name for meter in source.meters] if isinstance(source, MetersSection) else [config.device]


def feed_of(config: Config, boot: str, deliver: Deliver, energy: Energy | None) -> Feed:
    """The feed that makes the rows of this configuration."""
    if isinstance(config.source, MetersSection):
        return MeterFeed(config.source, boot, deliver)
    return WaveformFeed(config, config.source, boot, deliver, energy)
