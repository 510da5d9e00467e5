"""Messages as daemons publish them."""

from __future__ import annotations

from typing import Any

import orjson

from acqd.telemetry.event import PowerEvent
from acqd.telemetry.quality_row import QualityRow
from acqd.timestamps import filetime, rfc3339
from tests.storage.rows import T0


def summary(device: str = "cell.1", channel: str = "total", **other: Any) -> tuple[str, bytes]:
    """Topic and payload of a 1 s summary."""
    values = {
        "device": device, "channel": channel, "boot": "b1", "seq": 5, "time": "2026-11-23T01:13:01.000000Z",
        "rows": 25, "Vrms": 230.1, "Irms": 0.88, "P": 539.3, "P_min": 539.0, "P_max": 540.0, "S": 609.2, "PF": 0.885,
        "f": 50.01, "W": 0.25, "W_import": 0.5, "W_export": 0.25, "flags": ["simulated"], "schema": 1,
    }  # fmt: skip
    return f"acqd/{device}/{channel}/summary", orjson.dumps(values | other)


def status(daemon: str, **other: Any) -> tuple[str, bytes]:
    """Topic and payload of the status of a daemon that is online."""
    values = {"state": "online", "device": daemon, "boot": "b1", "source": "simulated", "simulated": True}
    return f"acqd/{daemon}/status", orjson.dumps(values | other)


def quality(
    channel: str = "L1", aggregation: str = "150/180", t: float = T0, device: str = "cell1", **other: Any
) -> tuple[str, bytes]:
    """Topic and payload of a row of power quality."""
    ns = int(t * 1e9)
    values: dict[str, Any] = {"V_thds": 2.5, "I_thds": 31.25, "Vrms": 230.5, "V_h": [230.0, None, 5.0] + 47 * [0.0]}
    row = QualityRow(
        device, channel, "boot1", 7, rfc3339(ns), filetime(ns), aggregation, 3.0, 15, ["simulated"], **values | other
    )  # fmt: skip
    return f"acqd/{device}/{channel}/quality", row.to_json()


def event(duration: float | None = 0.1, t: float = T0, **other: Any) -> tuple[str, bytes]:
    """Topic and payload of a dip."""
    ns = int(t * 1e9)
    values: dict[str, Any] = {"number": 3, "kind": "dip", "extreme": 161.0, "reference": 230.0} | other
    sent = PowerEvent(
        "cell1", "boot1", values["number"], values["kind"], rfc3339(ns), filetime(ns), duration, values["extreme"],
        values["reference"], False, None, ["L1"], [], None,
    )  # fmt: skip
    return "acqd/cell1/event", sent.to_json()
