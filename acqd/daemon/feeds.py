"""The feed of a configuration: metered samples, meters that are read, or several boxes of either kind."""

from __future__ import annotations

import logging

from acqd.daemon import nominal
from acqd.daemon.box import Box
from acqd.daemon.config import Config
from acqd.daemon.events.watch import Announce
from acqd.daemon.feed import ALONE, Company, Deliver, Feed, Sent
from acqd.daemon.feed_of_boxes import FeedOfBoxes
from acqd.daemon.meter_feed import MeterFeed
from acqd.daemon.modbus_sections import MetersSection
from acqd.daemon.quality_feed import DeliverQuality
from acqd.daemon.waveform_feed import WaveformFeed
from acqd.plc.forked import Nursery

_log = logging.getLogger(__name__)


def feed_of(
    config: Config,
    boot: str,
    deliver: Deliver,
    sent: Sent | None,
    quality: DeliverQuality | None = None,
    announce: Announce | None = None,
    company: Company = ALONE,
) -> Feed:
    """The feed that makes the rows of this configuration.

    `quality` takes those of power quality, `announce` takes voltage events.
    """
    if config.sources:
        alone = [config.of_source(box) for box in config.sources]
        nursery = Nursery()

        def make(one: Config, boot: str) -> Feed:
            beside = Company(", ".join(one.devices), nursery.spawn, company.archive)
            return feed_of(one, boot, deliver, sent, quality, announce, beside)

        return FeedOfBoxes([Box(one, make) for one in alone], boot, nursery.close)
    if isinstance(config.source, MetersSection):
        if config.quality.enabled:
            _log.warning("%s: no power quality, which needs samples: RMS meters send none", ", ".join(config.devices))
        return MeterFeed(config.source, boot, deliver, company.name)
    if config.quality.enabled and quality is None:
        _log.warning("%s: no power quality: [mqtt] is not enabled, and nobody else takes its rows", config.device)
    return WaveformFeed(nominal.applied(config), config.source, boot, deliver, sent, quality, announce, company)
