"""Messages as daemons publish them."""

from __future__ import annotations

from typing import Any

import orjson


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
