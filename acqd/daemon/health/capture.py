"""The endpoint /capture: the newest samples of a running daemon as an NPZ file, and the client that asks for them.

The samples come out of the ring between MAIN_FAST and MAIN_SLOW, which holds the last seconds anyway: nothing is kept
for this purpose. The ring is anonymous memory of the daemon, so another process has to ask the daemon.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from http.client import HTTPConnection, HTTPException
from urllib.parse import parse_qs, urlencode

import orjson

from acqd.daemon.health.section import HealthSection
from acqd.errors import OperationError, UserError
from acqd.sources.npz_write import npz_bytes
from acqd.sources.waveform import Waveform

CAPTURE = "/capture"
MOST_S = 10.0
"""s of samples at most; the ring may hold less."""
_PATIENCE_S = 5.0
_MOST_BYTES = 1 << 30
_WHICH = "there are no samples yet, or this daemon has several sources: choose one with --device"


class CapturePage:
    """Answers GET /capture?seconds=1&device=NAME."""

    def __init__(self, capture: Callable[[str, float], Waveform | None]) -> None:
        """`capture` is called in the event loop."""
        self._capture = capture
        self.loop: asyncio.AbstractEventLoop | None = None

    def page(self, query: str) -> tuple[int, str, bytes]:
        """Status code, content type and body; called in a thread."""
        asked = parse_qs(query)
        device = asked.get("device", [""])[0]
        try:
            seconds = float(asked.get("seconds", ["1"])[0])
        except ValueError:
            seconds = 0.0
        if not 0 < seconds <= MOST_S:
            return _refusal(400, f"seconds: expected a number above 0, and {MOST_S:g} at most")
        waveform = self._in_loop(device, seconds)
        if waveform is None:
            return _refusal(
                404, f"there are no samples of {device[:64]}; acqd watch shows the devices" if device else _WHICH
            )
        return 200, "application/octet-stream", npz_bytes(waveform)

    def _in_loop(self, device: str, seconds: float) -> Waveform | None:
        assert self.loop is not None

        async def copy() -> Waveform | None:
            return self._capture(device, seconds)

        return asyncio.run_coroutine_threadsafe(copy(), self.loop).result(_PATIENCE_S)


def captured(section: HealthSection, device: str, seconds: float) -> bytes:
    """The NPZ file of the last `seconds` from the daemon of this computer.

    Raises UserError when the daemon refuses, OperationError without a daemon.
    """
    if not section.port:
        raise UserError("[health] port is 0: the daemon has no endpoint to ask for samples")
    connection = HTTPConnection(section.host, section.port, timeout=2 * _PATIENCE_S)
    where = f"http://{section.host}:{section.port}{CAPTURE}"
    try:
        connection.request("GET", f"{CAPTURE}?{urlencode({'device': device, 'seconds': seconds})}")
        answer = connection.getresponse()
        body = answer.read(_MOST_BYTES)
    except (OSError, HTTPException) as error:
        reason = getattr(error, "strerror", None) or str(error) or type(error).__name__
        raise OperationError(f"no answer at {where} ({reason}); is the daemon running?") from None
    finally:
        connection.close()
    if answer.status == 200 and body[:2] == b"PK":
        return body
    try:
        reason = orjson.loads(body)["error"]
    except (ValueError, KeyError, TypeError):
        reason = "what answers there is no daemon of acqd"
    raise UserError(f"{where}: {reason}")


def _refusal(code: int, reason: str) -> tuple[int, str, bytes]:
    return code, "application/json", orjson.dumps({"error": reason})
