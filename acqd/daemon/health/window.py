"""The newest window's samples as JSON: the endpoint /window of the daemon.

The samples are copied and encoded when somebody asks, in the thread of the endpoint. MAIN_SLOW keeps references only.
"""

from __future__ import annotations

from collections.abc import Callable
from urllib.parse import parse_qs

import orjson

from acqd.plc.recent import SampledWindow
from acqd.timestamps import filetime, rfc3339

WINDOW = "/window"
WindowOf = Callable[[str], tuple[str, SampledWindow | None] | None]
"""Device name and newest window of a device ("": the first one); None for a device that the daemon does not have."""
_NONE_YET = "no whole window yet, or the source has no samples (an RMS meter)"


def window_page(window_of: WindowOf) -> Callable[[str], tuple[int, str, bytes]]:
    """The endpoint: `?device=NAME`; 404 for an unknown device, 503 while there is no whole window."""

    def page(query: str) -> tuple[int, str, bytes]:
        code, body = _answer(window_of, parse_qs(query).get("device", [""])[0])
        return code, "application/json", body

    return page


def _answer(window_of: WindowOf, device: str) -> tuple[int, bytes]:
    known = window_of(device)
    if known is None:
        return 404, orjson.dumps({"error": f"this daemon has no device {device!r}"})
    name, window = known
    if window is None:
        return 503, orjson.dumps({"error": f"{name}: {_NONE_YET}"})
    return 200, orjson.dumps(as_json(name, window))


def as_json(device: str, window: SampledWindow) -> dict[str, object]:
    """`codes` per channel; times `scale` they are V and A. `seq` and `filetime` are as in the window's row."""
    form = window.form
    channels = [form.channel_name(k) for k in range(2 * form.phases)]
    return {
        "device": device,
        "seq": window.seq,
        "time": rfc3339(window.utc_ns),
        "filetime": filetime(window.utc_ns),
        "rate": form.rate,
        "f_nominal": form.f_nominal,
        "flags": sorted(window.flags),
        "channels": channels,
        "scale": list(form.scale),
        "codes": [window.codes[:, k].tolist() for k in range(len(channels))],
    }
