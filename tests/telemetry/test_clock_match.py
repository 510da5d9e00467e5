"""Receipts say what time it is at the sink: which differences are said, and which are not."""

from __future__ import annotations

import pytest

from acqd.telemetry.clock_match import ClockMatch
from acqd.timestamps import rfc3339

T0 = 1_790_000_000


class Clocks:
    """A wall clock here, one at the sink, and time that passes for both."""

    def __init__(self, ahead_s=0.0):
        self.here_s, self.there_s, self.up_s = float(T0), T0 + ahead_s, 100.0
        self.match = ClockMatch(lambda: round(self.here_s * 1e9), lambda: self.up_s)

    def receipts(self, seconds, delay_s=0.0, sink="s"):
        for _ in range(int(seconds)):
            self.here_s, self.there_s, self.up_s = self.here_s + 1, self.there_s + 1, self.up_s + 1
            self.match.heard(sink, rfc3339(round((self.there_s - delay_s) * 1e9), 3))


@pytest.mark.parametrize("ahead_s", [2 * 86_400.0, -40 * 86_400.0, 61.0, 1_790_000_000.0 - 5, 80 * 31_557_600.0])
def test_a_clock_that_differs_is_said_within_ten_seconds(ahead_s):
    clocks = Clocks(ahead_s)
    clocks.receipts(4)
    assert not clocks.match.trouble, "one receipt may be late"
    clocks.receipts(4)
    assert rfc3339(round(clocks.there_s * 1e9), 0) in clocks.match.trouble and "sink s" in clocks.match.trouble


def test_clocks_that_agree_receipts_that_are_late_and_a_sink_that_is_away_say_nothing():
    clocks = Clocks(0.4)
    clocks.receipts(20, delay_s=50.0)
    assert not clocks.match.trouble
    clocks.receipts(20, delay_s=400.0)
    assert not clocks.match.trouble, "receipts of before still count"
    clocks.up_s += 3_600
    assert not clocks.match.trouble


def test_one_sink_that_agrees_is_enough_and_a_clock_that_was_set_right_ends_it():
    clocks = Clocks(-86_400.0)
    clocks.receipts(20)
    assert clocks.match.trouble
    clocks.here_s = clocks.there_s
    clocks.receipts(1)
    assert not clocks.match.trouble


NO_TIMES = ["", "soon", "9999-99-99T00:00:00Z", "0001-01-01T00:00:00+23:59", "0001-01-01T00:00:00+14:00",
            "9999-12-31T23:59:59-12:00", "1600-01-01T00:00:00Z", "x" * 5000]  # fmt: skip


@pytest.mark.parametrize("text", NO_TIMES)
def test_what_is_no_time_is_ignored(text):
    clocks = Clocks()
    for _ in range(10):
        clocks.up_s += 1
        clocks.match.heard("s", text)
        assert not clocks.match.trouble
