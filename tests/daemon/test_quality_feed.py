"""Which rows of power quality a daemon makes."""

from __future__ import annotations

import numpy as np
import pytest

from acqd.daemon.config import Config
from acqd.daemon.feeds import feed_of
from acqd.daemon.quality_feed import QualityFeed
from acqd.daemon.quality_section import QualitySection
from acqd.metering import SampleBlock, StreamFormat
from tests.metering.quality.waves import T0, three_phases

RATE = 4_000.0


@pytest.mark.parametrize(
    ("interval", "kinds"), [("10/12", {"10/12", "150/180", "10s"}), ("150/180", {"150/180", "10s"}), ("10min", {"10s"})]
)
def test_rows_from_the_configured_aggregation_on_are_numbered_without_a_hole(interval, kinds):
    feed = QualityFeed(QualitySection(enabled=True, interval=interval), "cell1", 230.0, lambda: "boot1")
    feed.open(StreamFormat(RATE, (1.0,) * 6, bits=64))
    x = three_phases(2 * np.pi * 50 * np.arange(int(11 * RATE)) / RATE)
    rows = [
        row
        for first in range(0, len(x), 4_000)
        for row in feed.take(SampleBlock(x[first : first + 4_000], first, T0 + first * 250_000))
    ]
    assert {row.aggregation for row in rows} == kinds
    assert {(row.device, row.boot) for row in rows} == {("cell1", "boot1")}
    numbers = sorted({row.seq for row in rows})
    assert numbers == list(range(len(numbers)))


def test_meters_without_samples_are_said_to_have_no_power_quality(caplog):
    source = {"kind": "meters", "host": "127.0.0.1", "meters": [{"name": "press-1", "profile": "em340"}]}
    config = Config(source=source, quality=QualitySection(enabled=True))
    feed_of(config, "boot1", lambda *_: None, lambda _: None, lambda _: None)
    assert "press-1: no power quality, which needs samples" in caplog.text


def test_a_daemon_without_mqtt_says_that_it_computes_no_power_quality(caplog):
    config = Config(quality=QualitySection(enabled=True))
    feed_of(config, "boot1", lambda *_: None, None)
    assert f"{config.device}: no power quality: [mqtt] is not enabled" in caplog.text


def test_mains_of_another_frequency_than_configured_are_said_once_in_the_log(caplog):
    feed = QualityFeed(QualitySection(enabled=True), "cell1", 230.0, lambda: "boot1")
    feed.open(StreamFormat(RATE, (1.0,) * 6, bits=64))
    x = three_phases(2 * np.pi * 60 * np.arange(int(2 * RATE)) / RATE)
    rows = feed.take(SampleBlock(x, 0, T0))
    assert all("off_nominal" in row.flags for row in rows)
    (line,) = caplog.messages
    assert line.startswith("cell1: no fundamental near 50 Hz") and "f_nominal" in line
