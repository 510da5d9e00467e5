"""Healthy or not, and why."""

from __future__ import annotations

import pytest

from acqd.daemon.health.snapshot import Acknowledged, Cycles, Delivery, Link, SourceLink
from acqd.daemon.health.verdict import verdict
from tests.daemon.health.snapshots import daemon, sink


@pytest.mark.parametrize("snapshot", [daemon(), sink(), daemon(broker=None, delivery=None), daemon(synchronised=None)])
def test_a_service_that_works_is_ready_without_a_word(snapshot):
    judged = verdict(snapshot)
    assert judged.ready and not judged.problems and not judged.notes


@pytest.mark.parametrize(
    ("snapshot", "alive", "word"),
    [
        (daemon(alive=False, last_row_age_s=31.0), False, "31 s"),
        (daemon(alive=False, last_row_age_s=None), False, "since the start"),
        (daemon(source=SourceLink(False, trouble="no answer from the PLC")), True, "no answer from the PLC"),
        (daemon(broker=Link(False)), True, "broker away"),
        (daemon(broker=Link(False, trouble="certificate has expired")), True, "away: certificate has expired"),
        (daemon(register_trouble="/a.json cannot be written: Stale"), True, "energy register: /a.json cannot be"),
        (daemon(delivery=Delivery(spool_bytes=91, spool_limit_bytes=100)), True, "91 % full"),
        (daemon(delivery=Delivery(disk_trouble="no space left")), True, "no space left"),
        (daemon(delivery=Delivery(reading_trouble="a.seg cannot be read: Input/output error")), True, "cannot be read"),
        (daemon(delivery=Delivery(unreceipted_s=56.0)), True, "no receipt for 56 s"),
        (
            daemon(delivery=Delivery(clock_trouble="this computer's clock says 1970")),
            True,
            "this computer's clock says",
        ),
        (daemon(delivery=Delivery(rights_trouble="acqd/c/L1/power", unreceipted_s=56.0)), True, "rows refused: acqd/c"),
        (daemon(delivery=Delivery(receipt_lag_s=3.1)), True, "receipts late: rows wait 3.1 s"),
        (daemon(delivery=Delivery(left_behind="3 rows of device old wait")), True, "spool: 3 rows of device old"),
        (daemon(certificate_trouble="certificate /a.pem ends in 3 days"), True, "ends in 3 days"),
        (sink(boots_trouble="two daemons publish as device c"), True, "name taken: two daemons"),
        (sink(refused_trouble="the database refuses rows of c: no site"), True, "the database refuses rows of c"),
        (daemon(delivery=Delivery(spool_age_s=3e6, old_after_s=2.6e6)), True, "34.7 days"),
        (daemon(delivery=Delivery(dropped=7)), True, "7 messages were dropped"),
        (daemon(delivery=Delivery(deleted=1)), True, "1 time somebody deleted or changed files of the spool"),
        (daemon(delivery=Delivery(gone_back=2)), True, "2 times the database of a sink was found in an earlier state"),
        (daemon(delivery=Delivery(cuts=1, cuts_unconfirmed=1)), True, "no sink has said which rows it has"),
        (daemon(delivery=Delivery(dropped=8), acknowledged=Acknowledged(dropped=7)), True, "8 messages were dropped"),
        (sink(quarantined=3), True, "3 messages are in quarantine"),
        (sink(quarantined=3, impossible=2), True, "3 messages are in quarantine, 2 of them rows whose time cannot be"),
        (daemon(broker=Link(True, 9, "connections end within seconds: ...")), True, "name taken"),
        (sink(recalls=1), True, "earlier state"),
        (sink(clock_trouble="this computer's clock was set back"), True, "clock"),
        (sink(upkeep_trouble="maintenance: the newest row is 40 days before this clock"), True, "40 days"),
        (sink(lag_s=21.0), True, "21.0 s"),
        (sink(disk_days=3.2), True, "3.2 days"),
        (sink(database=Link(False, trouble="connection refused")), True, "connection refused"),
        (sink(alive=False), False, "hangs"),
    ],
)
def test_what_keeps_rows_from_arriving_is_a_problem(snapshot, alive, word):
    judged = verdict(snapshot)
    assert not judged.ready and judged.alive == alive
    assert len(judged.problems) == 1 and word in judged.problems[0]


@pytest.mark.parametrize(
    "snapshot",
    [
        daemon(delivery=Delivery(dropped=7), acknowledged=Acknowledged(dropped=7)),
        daemon(delivery=Delivery(deleted=1), acknowledged=Acknowledged(deleted=1)),
        daemon(delivery=Delivery(gone_back=1), acknowledged=Acknowledged(recalls=1)),
        daemon(delivery=Delivery(cuts=1)),
        daemon(delivery=Delivery(alone_s=31.0, waiting=9)),
        daemon(delivery=Delivery(registers_back="W of cell1 began at 1 kWh, and an earlier run had published 2 kWh")),
        daemon(cycles=Cycles(restarts=1)),
        daemon(synchronised=False),
        daemon(source=SourceLink(True, trouble="the range has changed")),
        sink(quarantined=3, acknowledged=Acknowledged(quarantined=3)),
    ],
)
def test_what_does_not_is_a_note(snapshot):
    judged = verdict(snapshot)
    assert judged.ready and len(judged.notes) == 1
