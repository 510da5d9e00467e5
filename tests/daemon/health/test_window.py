"""The endpoint /window: the samples of the newest row."""

from __future__ import annotations

import asyncio
import json
from http.client import HTTPConnection
from types import SimpleNamespace

import numpy as np
import pytest

from acqd.daemon.config import Config
from acqd.daemon.feed_of_boxes import FeedOfBoxes
from acqd.daemon.health.daemon import DaemonHealth, Progress
from acqd.daemon.health.section import HealthSection
from acqd.daemon.health.window import window_page
from acqd.daemon.waveform_feed import WaveformFeed
from acqd.telemetry.broker import free_port
from tests.waiting import finish, until


def asked(port, path):
    connection = HTTPConnection("127.0.0.1", port, timeout=60)
    connection.request("GET", path)
    answer = connection.getresponse()
    return answer.status, json.loads(answer.read())


def test_the_samples_are_those_of_the_row_with_the_same_number():
    rows, port, answers = {}, free_port(), []

    def keep(new, *_):
        rows.update({(row.seq, row.channel): row for row in new})

    async def scenario():
        config = Config(device="press", health=HealthSection(port=port), realtime={"priority": 0})
        feed = WaveformFeed(config, config.source, "boot", keep)
        health = DaemonHealth(config.health, "press", feed, lambda: Progress(0))
        await feed.start()
        running = asyncio.create_task(feed.run())
        health.start()
        await until(lambda: len(rows) > 20, "rows")
        paths = ("/window?device=press", "/window?device=other", "/window", "/status")
        answers.extend([await asyncio.to_thread(asked, port, path) for path in paths])
        await until(lambda: (answers[0][1]["seq"], "L1") in rows, "the row of the window")
        health.stop()
        await feed.stop()
        await running
        feed.close()

    finish(scenario())
    (code, window), (unknown, error), (_, first), (_, status) = answers
    assert code == 200 and unknown == 404 and "other" in error["error"] and first["device"] == "press"
    row = rows[window["seq"], "L1"]
    u, i = (np.array(window["codes"][k]) * window["scale"][k] for k in (0, 1))
    assert window["channels"][:2] == ["U1", "I1"] and window["filetime"] == row.filetime
    assert "simulated" in window["flags"]
    assert np.sqrt((u**2).mean()) == pytest.approx(row.Vrms, rel=2e-3)
    assert (u * i).mean() == pytest.approx(row.P, rel=5e-3)
    cycles = status["cycles"]
    assert sum(cycles["slow"]["counts"]) >= 1 and sum(cycles["latency"]["counts"]) > 10


def test_a_meter_without_samples_says_so():
    code, _, body = window_page(lambda _: ("press-1", None))("device=press-1")
    assert code == 503 and b"no samples" in body


def test_a_daemon_with_several_sources_shows_the_window_of_each():
    def box(name, feed):
        return SimpleNamespace(feed=feed, name=name, config=SimpleNamespace(devices=[name]))

    def running(name):
        return SimpleNamespace(window=lambda device: (name, f"samples of {name}") if device in ("", name) else None)

    boxes = FeedOfBoxes([box("a", running("a")), box("b", running("b")), box("away", None)], "boot")
    assert boxes.window("b") == ("b", "samples of b") and boxes.window("") == ("a", "samples of a")
    assert boxes.window("away") == ("away", None) and boxes.window("other") is None
