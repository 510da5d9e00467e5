"""Notices: each one reaches the broker, also over a broken connection; the oldest go when too many wait."""

from __future__ import annotations

from acqd.telemetry.delivery import Delivery
from acqd.telemetry.message import Room
from acqd.telemetry.notices import Notices
from acqd.telemetry.spool import Spool
from tests.telemetry.test_delivery import Bench

ROOM = Room(64, 64)


def test_a_notice_is_sent_until_it_is_acknowledged():
    bench = Bench()
    bench.box.begin()
    bench.box.put_notice("acqd/t/event", b"one")
    (first,) = bench.messages(ROOM)
    assert (first.topic, first.payload, first.retain) == ("acqd/t/event", b"one", False)
    assert bench.messages(ROOM) == [] and len(bench.box) == 1
    bench.box.end()
    bench.box.begin()
    (again,) = bench.messages(ROOM)
    bench.box.acknowledged(again)
    bench.box.begin()
    assert bench.messages(ROOM) == [] and len(bench.box) == 0


def test_notices_do_not_count_as_rows():
    box = Delivery(Spool(None), "acknowledged", ["t"])
    box.put_notice("acqd/t/event", b"one")
    (message,) = box._notices.take(9)
    box.acknowledged(message)
    assert box.delivered == 0


def test_the_oldest_notices_are_given_up_when_too_many_wait():
    notices = Notices()
    for k in range(1_005):
        notices.put("acqd/t/event", str(k).encode())
    assert len(notices) == 1_000 and notices.dropped == 5
    assert next(message.payload for message in notices.take(2_000)) == b"5"
