"""A line per change of state."""

from __future__ import annotations

import logging

from acqd.changes import StateLog


def test_trouble_is_written_once_and_its_end_says_how_long_and_how_often(caplog):
    caplog.set_level(logging.INFO)
    now = 100.0
    says = StateLog(logging.getLogger("test"), lambda: now)
    for attempt in range(38):
        says.trouble("broker", "refused", f"connection refused from port {attempt}")
    now += 66.0
    assert says.state("broker") == "refused"
    assert says.fine("broker", "connected")
    assert not says.fine("broker", "connected")
    assert caplog.messages == [
        "broker: connection refused from port 0",
        "broker: connected (after 66.0 s, 37 more failures)",
    ]
    assert says.state("broker") == ""


def test_another_state_and_another_subject_are_changes(caplog):
    says = StateLog(logging.getLogger("test"))
    says.trouble("broker", "refused", "connection refused")
    says.trouble("broker", "password", "bad user name or password")
    says.trouble("database", "refused", "connection refused")
    says.trouble("broker", "password", "bad user name or password")
    assert len(caplog.messages) == 3
