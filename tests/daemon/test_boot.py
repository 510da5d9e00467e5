"""Time within one boot only rises."""

from __future__ import annotations

from acqd.daemon.boot import Boot
from acqd.telemetry.row import PowerRow


def row(filetime, channel):
    return PowerRow("d", channel, "", 0, "", filetime, *(0.0,) * 7, [])


def stamped(boot, *filetimes):
    rows = [row(filetime=filetime, channel=channel) for filetime in filetimes for channel in ("L1", "total")]
    boot.stamp(rows)
    return [one.boot for one in rows[::2]], {one.boot for one in rows}


def test_a_clock_that_was_set_back_starts_another_boot():
    boot = Boot("b1")
    assert stamped(boot, 100, 101, 102) == (["b1"] * 3, {"b1"})
    assert stamped(boot, 103, 50, 51)[0] == ["b1", "b1.1", "b1.1"]
    assert stamped(boot, 52, 10)[0] == ["b1.1", "b1.2"]
    assert boot.name == "b1.2"
