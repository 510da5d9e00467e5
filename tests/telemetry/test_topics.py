"""Names of devices in topics."""

from __future__ import annotations

from acqd.telemetry import topics
from acqd.telemetry.topics import Place, valid_device


def test_device_names_that_would_break_topics_are_refused():
    assert valid_device("cell-1.a_B")
    assert not any(valid_device(name) for name in ("", "a/b", "a+", "#", "a b", "x" * 65))


def test_a_topic_says_what_its_messages_hold_and_of_what():
    stream = {"power": topics.power, "quality": lambda *of: topics.row(of[0], topics.quality_stream(of[1]))}
    assert [topics.place(make("a", "L1")) for make in stream.values()] == [Place(kind, "a", "L1") for kind in stream]
    assert topics.place(topics.row("a", topics.register_stream("total"))) == Place("registers", "a", "total")
    of_devices = {"window": topics.window, "event": topics.event, "ask": topics.ask}
    assert [topics.place(make("a")) for make in of_devices.values()] == [Place(kind, "a") for kind in of_devices]
    for other in ("acqd/a/power", "acqd/a/L1/window", "x/a/L1/power", "acqd/a/b/L1/power", "acqd/a/status", ""):
        assert topics.place(other) == Place("other")
