"""What a box says of itself over several lives of its feed, and what follows for metrics and pages."""

from __future__ import annotations

import asyncio
from types import SimpleNamespace

import pytest

from acqd.daemon.box import Box
from acqd.daemon.feed_of_boxes import FeedOfBoxes
from acqd.daemon.health.metrics import metrics
from acqd.daemon.health.snapshot import FeedHealth, SourceLink, Windows
from acqd.daemon.health.verdict import verdict
from acqd.daemon.tally import Tally
from acqd.errors import OperationError
from acqd.retry import RetryPolicy
from tests.daemon.health.snapshots import daemon
from tests.storage.rows import row
from tests.waiting import finish, until


class Feed:
    """Delivers ten windows, three of them flagged, and fails when it is told to."""

    def __init__(self, boot):
        self.boot, self.found, self.fails = boot, asyncio.Event(), asyncio.Event()

    async def start(self):
        await self.found.wait()

    async def run(self):
        await self.fails.wait()
        raise OperationError("the gateway is gone")

    async def stop(self):
        self.fails.set()

    def save(self):
        pass

    def close(self):
        pass

    def alive(self):
        return True

    def health(self):
        return FeedHealth(self.boot, SourceLink(True, 1, "", 5), 0.1, windows=Windows(10, 3, {"gap": 2, "late": 1}))


def test_counts_of_a_box_go_on_when_its_feed_is_made_again(monkeypatch):
    monkeypatch.setattr("acqd.daemon.box._AGAIN", RetryPolicy(first_s=0.01, longest_s=0.01))
    feeds, seen = [], []

    def make(_config, boot):
        feeds.append(Feed(boot))
        if len(feeds) == 1:
            feeds[0].found.set()
        return feeds[-1]

    async def scenario():
        config = SimpleNamespace(devices=["press"], source=SimpleNamespace(kind="modbus"))
        box = Box(config, make)
        boxes = FeedOfBoxes([box], "boot")
        await boxes.start()
        seen.append(box.health())
        feeds[0].fails.set()
        await until(lambda: len(feeds) == 2, "the failure")
        seen.append(box.health())
        feeds[1].found.set()
        await until(lambda: box.feed is not None, "the second feed")
        seen.extend([box.health(), boxes.health()])
        await boxes.stop()

    finish(scenario())
    first, between, second, together = seen
    assert (first.windows.made, first.source.lost, first.restarts) == (10, 5, 0)
    assert not between.source.connected and (between.windows.made, between.source.lost) == (10, 5)
    assert second.windows == Windows(20, 6, {"gap": 4, "late": 2}) and second.source.lost == 10
    assert second.restarts == 1 and second.source.reconnects == 2 and first.boot != second.boot
    assert together.windows.made == 20 and together.source.reconnects == 3 and together.boxes == (second,)


def boxes(**changes):
    """Snapshot of a daemon with two sources, of which the second is away."""
    from acqd.daemon.health.snapshot import BoxHealth, Cycles

    here = BoxHealth("press", ("press",), "ads", SourceLink(True, 0, "", 7), windows=Windows(50, 2, {"gap": 2}),
                     cycles=Cycles(1000, 3, 2, 1, 0), last_row_age_s=0.1, boot="b")  # fmt: skip
    away = BoxHealth("m1, m2", ("m1", "m2"), "meters", SourceLink(False, 4, "no answer", 0), restarts=2)
    return daemon(boxes=(here, away), source=SourceLink(False), **changes)


def test_metrics_and_sentences_name_the_box():
    page = metrics(boxes()).decode()
    labels = 'name="cell1",service="daemon"'
    for line in (
        f'acqd_box_connected{{box="m1, m2",{labels}}} 0.0',
        f'acqd_box_windows_flagged_total{{box="press",flag="gap",{labels}}} 2.0',
        f'acqd_box_samples_lost_total{{box="press",{labels}}} 7.0',
        f'acqd_box_cycles_exceeded_total{{box="press",{labels}}} 1.0',
        f'acqd_box_restarts_total{{box="m1, m2",{labels}}} 2.0',
    ):
        assert line in page
    assert 'acqd_box_cycles_missed_total{box="m1, m2"' not in page
    judged = verdict(boxes())
    assert judged.problems == ["source of m1, m2 away: no answer"]
    assert judged.notes == ["source of m1, m2 was started again 2 times after failures"]


def test_a_single_source_has_the_same_metrics_under_the_name_of_the_daemon():
    page = metrics(daemon(windows=Windows(9, 1, {"overrange": 1}))).decode()
    assert 'acqd_box_windows_flagged_total{box="cell1",flag="overrange",name="cell1",service="daemon"} 1.0' in page


@pytest.mark.parametrize(
    ("flags", "flagged", "told"),
    [
        ([[], []], 0, {}),
        ([["simulated"], ["simulated", "derived"]], 0, {}),
        ([["gap"], []], 1, {"gap": 1}),
        ([["gap"], ["gap", "late"]], 2, {"gap": 2, "late": 1}),
        ([["unsynchronised"], ["unsynchronised", "late"]], 1, {"unsynchronised": 2, "late": 1}),
    ],
)
def test_a_window_is_flagged_once_whatever_its_phases_say(flags, flagged, told):
    tally = Tally()
    rows = [row(k, channel=channel) for k in range(2) for channel in ("L1", "L2", "total")]
    for k, each in enumerate(rows):
        each.flags = flags[k // 3] if each.channel != "L2" else []
    tally.add(rows)
    total = tally.total()
    assert (total.made, total.flagged, total.flags) == (2, flagged, told)
