"""Rows under way, by the second in which they were sent."""

from __future__ import annotations

from acqd.telemetry.in_flight import InFlight
from acqd.telemetry.spool import SpooledRow, Stream

STREAM = Stream("box", "L1", "boot")


def rows(*numbers: int) -> list[SpooledRow]:
    return [SpooledRow(STREAM, number, b"") for number in numbers]


def test_nothing_is_under_way_where_the_older_row_is_overdue_and_the_later_one_has_its_receipt():
    flying = InFlight()
    flying.add(rows(1), 0.0)
    flying.add(rows(2), 10.0)
    assert flying.settle(STREAM, 2, 2) == 1 and flying.settled_sent == 10.0
    assert flying.oldest_s(12.0) == 12.0
    assert flying.overdue(32.0, 30.0) == 1
    assert (len(flying), flying.oldest_s(40.0)) == (0, 0.0)
