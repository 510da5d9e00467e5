"""Rows to InfluxDB as line protocol over HTTP, without a spool: what does not fit into memory is dropped and counted.

https://docs.influxdata.com/influxdb/v1/write_protocols/line_protocol_reference/
"""

from __future__ import annotations

import logging
import queue
import threading
from collections.abc import Iterable, Sequence

import orjson

from acqd.errors import UserError
from acqd.integrations.http import Answer, post
from acqd.integrations.rows import TOPICS, rows_of
from acqd.retry import Backoff
from acqd.telemetry.message import Message
from acqd.telemetry.row import PowerRow
from acqd.timestamps import utc_ns

_log = logging.getLogger(__name__)
_AT_ONCE = 5_000
_END_S = 20.0
_MALFORMED = 400
_COLLECT_S = 0.5
_TAG = str.maketrans({",": r"\,", "=": r"\=", " ": r"\ ", "\n": "", "\r": "", "\\": "/"})
_TEXT = str.maketrans({'"': r"\"", "\\": r"\\", "\n": ""})
_NUMBERS = ("Vrms", "Irms", "P", "S", "PF", "f", "W")


def line(row: PowerRow, measurement: str = "power") -> str:
    """A row in line protocol, with its time in ns; absent quantities are absent fields."""
    numbers = [f"{name}={value!r}" for name in _NUMBERS if (value := getattr(row, name)) is not None]
    text = [
        f'{name}="{value.translate(_TEXT)}"' for name, value in (("boot", row.boot), ("flags", " ".join(row.flags)))
    ]
    tags = f"device={row.device.translate(_TAG)},channel={row.channel}"
    return f"{measurement},{tags} {','.join([*numbers, f'seq={row.seq}i', *text])} {utc_ns(row.filetime)}"


class Influx:
    """A bridge whose rows a thread writes to the server."""

    def __init__(self, url: str, token: str | None = None, measurement: str = "power", waiting: int = 200_000) -> None:
        self._url, self._token, self._measurement = url, token, measurement
        self._lines: queue.Queue[str] = queue.Queue(waiting)
        self._ended = threading.Event()
        self._trouble = ""
        self._thread = threading.Thread(target=self._write, name="influx", daemon=True)
        self.written = self.dropped = self.refused = 0

    def __enter__(self) -> Influx:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        """Write what waits, as far as the server takes it at once."""
        self._ended.set()
        self._thread.join(_END_S)

    def subscriptions(self) -> Sequence[str]:
        """All rows."""
        return TOPICS

    def will(self) -> None:
        """No last will."""

    def begin(self) -> Iterable[Message]:
        """Nothing to send."""
        return ()

    def take(self, topic: str, payload: bytes) -> Iterable[Message]:
        """Rows; other messages are left out."""
        for row in rows_of(topic, payload):
            try:
                self._lines.put_nowait(line(row, self._measurement))
            except queue.Full:
                self.dropped += 1
        return ()

    def tick(self) -> Iterable[Message]:
        """Nothing is due."""
        return ()

    def _write(self) -> None:
        backoff = Backoff()
        batch: list[str] = []
        while not self._ended.is_set() or batch or not self._lines.empty():
            batch = batch or self._collected()
            if not batch:
                continue
            if self._send("\n".join(batch).encode(), len(batch)):
                batch = []
                backoff.reset()
            elif self._ended.wait(backoff.pause_s()):
                return

    def _collected(self) -> list[str]:
        """Lines that wait, after half a second at the latest."""
        try:
            batch = [self._lines.get(timeout=_COLLECT_S)]
        except queue.Empty:
            return []
        while len(batch) < _AT_ONCE and not self._lines.empty():
            batch.append(self._lines.get_nowait())
        return batch

    def _send(self, body: bytes, count: int) -> bool:
        """Whether the server has taken the lines, or has refused them for good."""
        headers = {"Authorization": f"Token {self._token}"} if self._token else {}
        try:
            answer = post(self._url, body, headers)
        except (OSError, ValueError) as error:
            self._say(str(error))
            return False
        if answer.good:
            self.written += count
            self._say("")
            return True
        self._say(f"{answer.code}: {_reason(answer)}")
        if answer.code != _MALFORMED:  # 404: the database is not made yet; 401: the token may be mended
            return False
        self.refused += count
        return True

    def _say(self, trouble: str) -> None:
        """Log a change of state, not every attempt."""
        if trouble and trouble != self._trouble:
            _log.warning("InfluxDB: %s; check url and token in [influx]; %d rows wait", trouble, self._lines.qsize())
        elif self._trouble and not trouble:
            _log.info("InfluxDB takes rows again; %d were dropped so far", self.dropped)
        self._trouble = trouble


def _reason(answer: Answer) -> str:
    try:
        return str(orjson.loads(answer.body)["error"])[:200]
    except (orjson.JSONDecodeError, KeyError, TypeError):
        return answer.reason


def check_url(url: str) -> None:
    """Raises UserError for a URL that asks for another precision than nanoseconds."""
    if "precision=" in url and "precision=ns" not in url and "precision=n&" not in f"{url}&":
        raise UserError("influx.url: acqd writes nanoseconds; set precision=ns, or leave it out")
