"""Every bad state has a line in the runbook."""

import pytest

from acqd.daemon.health.runbook import RUNBOOK, entry_for
from acqd.daemon.health.snapshot import Cycles, Delivery, Link, Snapshot, SourceLink
from acqd.daemon.health.verdict import verdict
from tests.places import ROOT

_DOCUMENT = ROOT / "docs" / "operations.md"


def test_the_entries_are_lines_of_the_document():
    lines = _DOCUMENT.read_text(encoding="utf-8").splitlines()
    for entry in RUNBOOK:
        line = next(line for line in lines if f'id="{entry.anchor}"' in line)
        assert entry.symptom in line and entry.steps in line, entry.anchor
    assert len({entry.anchor for entry in RUNBOOK}) == len(RUNBOOK)


@pytest.mark.parametrize("age", [None, 70.0])
def test_whatever_the_verdict_says_has_an_entry(age):
    away = Link(connected=False, trouble="connection refused")
    delivery = Delivery(dropped=3, spool_bytes=99, spool_limit_bytes=100, disk_trouble="no space left")
    said = []
    for source in (SourceLink(connected=False, trouble="cable"), SourceLink(connected=True, trouble="range")):
        for service in ("daemon", "sink"):
            snapshot = Snapshot(
                service=service, name="acqd", version="1", uptime_s=100.0, alive=False, last_row_age_s=age,
                source=source, broker=away, database=away,
                delivery=delivery, cycles=Cycles(restarts=2), synchronised=False, quarantined=4,
            )  # fmt: skip
            judged = verdict(snapshot)
            said += [*judged.problems, *judged.notes]
    assert len(said) >= 10
    assert [sentence for sentence in said if entry_for(sentence) is None] == []
    assert entry_for("nothing of the kind") is None


def test_services_that_do_not_answer_have_an_entry():
    from acqd.daemon.health.query import ask
    from acqd.daemon.health.section import HealthSection
    from acqd.telemetry.broker import free_port

    answer = ask(HealthSection(port=free_port()), "daemon")
    assert answer is not None and entry_for(answer.problems[0]) is not None


def test_every_check_of_the_doctor_has_an_entry():
    import re

    folder = ROOT / "acqd" / "daemon"
    named = {
        name for path in folder.glob("*checks.py") for name in re.findall(r'Finding\(\s*"([^"]+)"', path.read_text())
    }
    assert len(named) > 10
    never_bad = {"python", "training", "FMU export"}
    assert {name for name in named if entry_for(f"doctor: {name}") is None} == never_bad


def test_a_check_of_the_doctor_is_not_explained_by_a_sentence_of_the_status():
    assert entry_for("doctor: spool").anchor == "state-dir"
    assert entry_for("doctor: no rows") is None
    assert entry_for("spool 93 % full; rows will be dropped").anchor == "spool"
