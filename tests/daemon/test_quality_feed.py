"""Which rows of power quality a daemon makes."""

from __future__ import annotations

import numpy as np
import pytest
from pydantic import ValidationError

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


def test_blocks_of_a_window_make_the_rows_of_long_ones():
    """The last interval is complete with samples that wait for more."""
    x = three_phases(2 * np.pi * 50 * np.arange(int(1.62 * RATE)) / RATE)
    rows = []
    for length in (160, len(x)):
        feed = QualityFeed(QualitySection(enabled=True), "cell1", 230.0, lambda: "boot1")
        feed.open(StreamFormat(RATE, (1.0,) * 6, bits=64))
        starts = range(0, len(x), length)
        made = [row for k in starts for row in feed.take(SampleBlock(x[k : k + length], k, T0 + k * 250_000))]
        rows.append((made, feed.finish()))
    (early, rest), (whole, none) = rows
    assert len(rest) == 4 and not none
    assert early + rest == whole


def test_ten_minutes_that_end_in_the_last_second_have_a_flicker_severity():
    rate, begin_s = 2000.0, 600 * 2_000_000 - 61.05
    x = three_phases(2 * np.pi * 50 * np.arange(int(61.3 * rate)) / rate)
    feed = QualityFeed(QualitySection(enabled=True, interval="10min", flicker=True), "cell1", 230.0, lambda: "boot1")
    feed.open(StreamFormat(rate, (1.0,) * 6, bits=64))
    rows = []
    for k in range(0, len(x), 200):
        rows += feed.take(SampleBlock(x[k : k + 200], k, round((begin_s + k / rate) * 1e9)))
    rows += feed.finish()
    assert not feed.finish()
    assert [row.aggregation for row in rows].count("Pst") == 3


@pytest.mark.parametrize("interval", ["10/12", "10min"])
def test_a_telegram_is_recorded_from_its_begin_for_the_time_that_is_set(interval):
    """A dip, whose edges have lines at the carrier, begins no recording; the pause within a telegram ends none."""
    section = QualitySection(
        enabled=True, interval=interval, signalling_hz=316.67, signalling_threshold=0.5, signalling_s=1.4
    )
    feed = QualityFeed(section, "cell1", 230.0, lambda: "boot1")
    feed.open(StreamFormat(RATE, (1.0,) * 6, bits=64))
    t = np.arange(int(5 * RATE)) / RATE
    x = three_phases(2 * np.pi * 50 * t)
    x[:, 0::2] *= np.where((t > 1.03) & (t < 1.33), 0.4, 1.0)[:, None]
    keyed = ((t >= 2.1) & (t < 2.5)) | ((t >= 2.9) & (t < 3.3))
    x[:, 2] += 0.02 * 325 * np.cos(2 * np.pi * 316.67 * t) * keyed  # one phase suffices
    rows = [row for row in feed.take(SampleBlock(x, 0, T0)) if row.aggregation == "10/12"]
    recorded = [row for row in rows if "signalling" in row.flags and row.channel == "L2"]
    assert [round((row.filetime - recorded[0].filetime) / 2e6) for row in recorded] == list(range(7))
    assert 2.1 - 0.2 < (recorded[0].filetime * 100 - rows[0].filetime * 100) / 1e9 + (interval == "10min") * 2.0 < 2.1
    assert max(row.V_ms for row in recorded) == pytest.approx(4.6, rel=0.05)
    assert min(row.V_ms for row in recorded) < 0.1  # the pause
    if interval == "10min":
        assert len(rows) == 3 * 7 and all(row.Vrms and row.V_h is None for row in rows)
    else:
        assert all(row.V_h for row in rows if row.channel == "L2")


def test_a_threshold_needs_a_carrier():
    with pytest.raises(ValidationError, match="needs signalling_hz"):
        QualitySection(enabled=True, signalling_threshold=0.5)


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
