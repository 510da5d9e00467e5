"""Rows to InfluxDB as line protocol over HTTP, without a spool: what does not fit into memory is dropped and counted.

https://docs.influxdata.com/influxdb/v1/write_protocols/line_protocol_reference/
"""

from __future__ import annotations

import logging
import queue
import threading
from collections.abc import Iterable, Sequence

import orjson

from acqd.daemon.quality_section import BridgedQuality
from acqd.errors import UserError
from acqd.integrations.http import Answer, post
from acqd.integrations.influx_lines import event_line, line, quality_line
from acqd.integrations.quality import event_of, quality_of, subscriptions, wanted
from acqd.integrations.rows import TOPICS, rows_of
from acqd.retry import Backoff
from acqd.telemetry import topics
from acqd.telemetry.message import Message

_log = logging.getLogger(__name__)
_AT_ONCE = 5_000
_END_S = 20.0
_MALFORMED = 400
_COLLECT_S = 0.5


class Influx:
    """A bridge whose rows a thread writes to the server."""

    def __init__(
        self, url: str, token: str | None = None, measurement: str = "power", waiting: int = 200_000,
        quality: BridgedQuality = "10/12",
    ) -> None:  # fmt: skip
        """`waiting`: lines that are kept in memory; `quality`: rows of power quality from this aggregation on."""
        self._url, self._token, self._measurement, self._quality = url, token, measurement, quality
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
        """All rows, power quality and voltage events."""
        return *TOPICS, *subscriptions(self._quality)

    def will(self) -> None:
        """No last will."""

    def begin(self) -> Iterable[Message]:
        """Nothing to send."""
        return ()

    def take(self, topic: str, payload: bytes) -> Iterable[Message]:
        """Rows; what is none is left out."""
        for text in self._of(topic, payload):
            try:
                self._lines.put_nowait(text)
            except queue.Full:
                self.dropped += 1
        return ()

    def _of(self, topic: str, payload: bytes) -> list[str]:
        """Lines of a message."""
        if topic.endswith("/quality"):
            row = quality_of(topic, payload)
            good = row is not None and row.aggregation in wanted(self._quality)
            return [quality_line(row, self._measurement)] if row is not None and good else []
        if topics.is_event(topic):
            event = event_of(topic, payload)
            return [event_line(event, self._measurement)] if event is not None else []
        return [line(row, self._measurement) for row in rows_of(topic, payload)]

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
