"""When daemon and sink call themselves alive: the watchdog is fed exactly then."""

from __future__ import annotations

import socket
import time
from datetime import UTC, datetime, timedelta
from types import SimpleNamespace

import pytest

from acqd.daemon.health.daemon import DaemonHealth, Progress
from acqd.daemon.health.section import HealthSection
from acqd.daemon.health.sink import SinkHealth
from acqd.daemon.health.snapshot import Delivery, FeedHealth, Link, SourceLink
from acqd.daemon.health.verdict import verdict
from acqd.storage.sink import SinkCounters
from acqd.telemetry.certificates import Validity
from tests.commands import start
from tests.waiting import LIMIT_S, wait_for

OFF = HealthSection(port=0, sink_port=0)


class Feed:
    rows_arrive = True

    def alive(self):
        return self.rows_arrive

    def health(self):
        return FeedHealth("b00t", SourceLink(True), 0.02)

    def window(self, device):
        return device, None


@pytest.fixture
def clock(monkeypatch):
    now = SimpleNamespace(s=time.monotonic())
    monkeypatch.setattr(time, "monotonic", lambda: now.s)
    return now


def test_a_daemon_is_alive_while_rows_arrive_and_its_loop_turns(clock):
    feed = Feed()
    health = DaemonHealth(OFF, "cell1", feed, lambda: Progress(7, Delivery(waiting=3), Link(False)))
    assert health.alive()
    feed.rows_arrive = False
    assert not health.alive()
    feed.rows_arrive = True
    clock.s += 6
    assert not health.alive()  # the event loop is blocked
    health.turned()
    told = health.snapshot()
    assert told.alive and told.rows == 7 and verdict(told).problems == ["broker away"]


def test_a_sink_whose_database_is_away_is_alive_and_not_ready(clock):
    sink = SimpleNamespace(connected=True, counters=SinkCounters(rows=5, last_commit=clock.s))
    health = SinkHealth(OFF, sink, "s1")
    assert verdict(health.snapshot()).ready
    sink.counters.database_trouble = "connection refused"
    clock.s += 100
    told = health.snapshot()
    assert told.alive and told.last_row_age_s == pytest.approx(100)
    assert verdict(told).problems == ["database away: connection refused"]
    clock.s += 100
    assert not health.alive()
    health.turned()
    assert health.alive()


def test_the_certificate_that_the_broker_has_shown_is_a_problem_before_it_ends(clock):
    now = datetime.now(UTC)
    soon = now + timedelta(days=5.1)
    sink = SimpleNamespace(connected=True, counters=SinkCounters(certificate=Validity(soon, now - timedelta(days=700))))
    expected = [f"certificate of the broker ends in 5 days, on {soon:%Y-%m-%d}"]
    assert verdict(SinkHealth(OFF, sink, "s1").snapshot()).problems == expected
    for valid in (Validity(now + timedelta(days=305), now), Validity(soon, now - timedelta(days=1))):  # of 6 days
        sink.counters.certificate = valid
        assert verdict(SinkHealth(OFF, sink, "s1").snapshot()).ready


def test_systemd_hears_of_the_real_daemon(tmp_path, monkeypatch):
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as systemd:
        systemd.bind(str(tmp_path / "notify"))
        systemd.settimeout(LIMIT_S)
        monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "notify"))
        monkeypatch.setenv("WATCHDOG_USEC", "300000")
        config = tmp_path / "acqd.toml"
        config.write_text("[mqtt]\nenabled = false\n[health]\nport = 0\n")
        daemon = start("run", "--config", config, cwd=tmp_path)
        try:
            heard: list[str] = []

            def fed() -> bool:
                heard.append(systemd.recv(200).decode().split("\n")[0])
                return heard.count("WATCHDOG=1") > 3

            wait_for(fed, "the watchdog is fed")
        finally:
            daemon.terminate()
            daemon.communicate(timeout=LIMIT_S)
        assert "READY=1" in heard
