"""Questions for the last rows: asked while somebody waits, and not for ever."""

from __future__ import annotations

import asyncio

from acqd.telemetry import last_rows, topics
from acqd.telemetry.last_rows import LastRows
from acqd.telemetry.receipts import LastRow, Receipt
from tests.waiting import finish


def said(*last, boot="boot", sink="one"):
    """The answer of a sink."""
    return Receipt(sink, [], last=list(last), boot=boot)


def test_questions_are_asked_while_somebody_waits_and_end_with_an_answer():
    async def scenario():
        now = 100.0
        last = LastRows({"a": "boot"}, lambda: now)
        assert last.questions() == [] and set(last.subscriptions()) == {"acqd/a/receipt", "acqd/a/+/summary"}
        assert await last.of("b", 5.0) is None
        waiting = asyncio.create_task(last.of("a", 300.0))
        await asyncio.sleep(0)
        assert [message.topic for message in last.questions()] == ["acqd/a/ask"] and last.questions() == []
        now += 1.0
        assert len(last.questions()) == 1
        last.heard_summary("acqd/a/L1/summary", b'{"channel":"L1","boot":"boot.1","seq":7,"W_import":2,"W_export":1}')
        last.heard_summary("acqd/a/L2/summary", b'{"channel":"L2","boot":"other","seq":7,"W_import":2,"W_export":1}')
        last.heard_summary("acqd/a/L2/summary", b"offline")
        last.answered(
            "a", said(LastRow("L1", "boot", 8, 1.5), LastRow("L1", "boot", 6, 1.4), LastRow("L2", "x", 9, 1.0))
        )
        known = await waiting
        assert known.answered and known.stored == {"L1": LastRow("L1", "boot", 8, 1.5)}
        assert set(known.summaries) == {"L1"} and known.summaries["L1"].imported == 2.0
        now += 10.0
        assert last.questions() == []
        last = LastRows({"a": "boot"}, lambda: now)
        known = await last.of("a", 0.0)
        now += 5.0
        assert not known.answered and last.questions() == [], "nobody waits any more"

    finish(scenario())


def test_a_late_answer_about_an_earlier_boot_ends_no_question():
    async def scenario():
        last = LastRows({"a": "boot"})
        last.answered("a", said(LastRow("L1", "before", 9, 1.0)))
        last.answered("a", said(boot="before"))
        assert not (await last.of("a", 0.0)).answered
        last.answered("a", said())
        assert (await last.of("a", 0.0)).answered, "a sink that has no row of the boot"

    finish(scenario())


def test_the_sink_that_is_ahead_counts_and_one_that_is_silent_is_not_waited_for(monkeypatch):
    """Of two that are there; of a group, only one of them gets the question."""
    monkeypatch.setattr(last_rows, "_OTHERS_S", 0.02)
    sinks = {topics.sink_status("one"), topics.sink_status("two")}

    async def scenario(other):
        last = LastRows({"a": "boot"}, sinks=lambda: sinks)
        last.answered("a", said(LastRow("L1", "boot", 8, 1.5)))
        last.answered("a", said(LastRow("L1", "boot", 9, 1.6), sink=other))
        waiting = asyncio.create_task(last.of("a", 300.0))
        await asyncio.sleep(0)
        assert bool(last.questions()) == (other == "one"), "the one that is silent is asked again"
        known = await waiting
        assert known.answered and known.stored["L1"].seq == 9

    for other in ("one", "two"):
        finish(scenario(other))
