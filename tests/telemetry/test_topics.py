"""Names of devices in topics."""

from __future__ import annotations

from acqd.telemetry.topics import valid_device


def test_device_names_that_would_break_topics_are_refused():
    assert valid_device("cell-1.a_B")
    assert not any(valid_device(name) for name in ("", "a/b", "a+", "#", "a b", "x" * 65))
