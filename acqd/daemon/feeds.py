"""The feed of a configuration: metered samples, meters that are read, or several boxes of either kind."""

from __future__ import annotations

from collections.abc import Callable

from acqd.daemon.box import Box
from acqd.daemon.config import Config
from acqd.daemon.feed import Deliver, Feed
from acqd.daemon.feed_of_boxes import FeedOfBoxes
from acqd.daemon.meter_feed import MeterFeed
from acqd.daemon.modbus_sections import MetersSection
from acqd.daemon.waveform_feed import WaveformFeed
from acqd.telemetry.spool import Energy

Registers = Callable[[str], Energy | None]
"""The energy registers of a device after the last row that an earlier start has spooled."""


def feed_of(config: Config, boot: str, deliver: Deliver, registers: Registers) -> Feed:
    """The feed that makes the rows of this configuration."""
    if config.boxes:
        alone = [config.of_box(box) for box in config.boxes]
        return FeedOfBoxes([Box(one, lambda one, boot: feed_of(one, boot, deliver, registers)) for one in alone], boot)
    if isinstance(config.source, MetersSection):
        return MeterFeed(config.source, boot, deliver)
    return WaveformFeed(config, config.source, boot, deliver, registers(config.device))
