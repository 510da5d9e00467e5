"""From rows to the broker: spool, delivery and connector of one daemon."""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Callable, Sequence
from typing import Any

import orjson

from acqd.daemon.config import Config
from acqd.telemetry import topics
from acqd.telemetry.connector import Connector
from acqd.telemetry.counters import TelemetryCounters
from acqd.telemetry.delivery import Delivery
from acqd.telemetry.event import PowerEvent
from acqd.telemetry.quality_row import QualityRow
from acqd.telemetry.register_row import OnceAMinute, register_row
from acqd.telemetry.row import PowerRow
from acqd.telemetry.spool import Readings, Spool, SpooledRow, Stream, confirm

_log = logging.getLogger(__name__)
_SYNC_S = 0.8  # at most 1 s of rows is at risk when the power fails
_NO_SINK_S = 60.0


class Uplink:
    """Keeps rows until they are delivered, and delivers them."""

    def __init__(self, config: Config, devices: Sequence[str], greeting: Callable[[], bytes]) -> None:
        """`devices`: those whose rows will come. Raises UserError when the spool cannot be used."""
        self._config = config
        folder = config.state_dir / f"spool-{config.device}" if config.state_dir is not None else None
        self._spool = Spool(folder, config.spool.limits())
        self._delivery = Delivery(self._spool, config.spool.until, devices, windows=config.mqtt.rows == "window")
        self._connector = Connector(
            config.mqtt.address(),
            self._delivery,
            client_id=f"acqd-{config.device}",
            status_topic=topics.status(config.device),
            greeting=greeting,
        )
        self._folder = folder
        self._register_times = OnceAMinute()
        self._sync_failed = self._warned = False
        self._alone_since = time.monotonic()
        self.latest = self.counters()
        """The counters, at most a second old; for other threads than the event loop's."""

    def readings(self, device: str) -> Readings | None:
        """A device's registers after the last row that an earlier start has spooled."""
        before = self._spool.readings("") if device == self._config.device else None
        return self._spool.readings(device) or before

    def tasks(self) -> list[asyncio.Task[None]]:
        """Start to deliver; the tasks do not end by themselves."""
        if self._folder is None:
            _log.info("no state_dir: rows that are not delivered wait in memory only")
        return [asyncio.create_task(self._connector.run()), asyncio.create_task(self._sync())]

    def put(self, rows: Sequence[PowerRow], summaries: Sequence[dict[str, Any]], readings: Readings | None) -> None:
        """Take the rows of a window, and the summaries that they complete."""
        self._delivery.put_rows(
            [SpooledRow(Stream(row.device, row.channel, row.boot), row.seq, row.to_json()) for row in rows], readings
        )
        for summary in summaries:
            self._delivery.put_state(topics.summary(summary["device"], summary["channel"]), orjson.dumps(summary))
        if summaries and self._config.registers.enabled:
            self._put_registers(summaries)

    def _put_registers(self, summaries: Sequence[dict[str, Any]]) -> None:
        """A row of registers for each channel, once a minute."""
        due = [summary for summary in summaries if self._register_times.due(summary)]
        rows = [register_row(summary) for summary in due]
        self._delivery.put_rows(
            [
                SpooledRow(Stream(row.device, topics.register_stream(row.channel), row.boot), row.seq, row.to_json())
                for row in rows
            ]
        )

    def put_quality(self, rows: Sequence[QualityRow]) -> None:
        """Take rows of power quality."""
        self._delivery.put_rows(
            [
                SpooledRow(Stream(row.device, topics.quality_stream(row.channel), row.boot), row.seq, row.to_json())
                for row in rows
            ]
        )

    def put_event(self, event: PowerEvent) -> None:
        """Take a voltage event."""
        stream = Stream(event.device, topics.EVENTS, event.boot)
        self._delivery.put_rows([SpooledRow(stream, event.seq, event.to_json())])

    def put_status(self, payload: bytes) -> None:
        """Publish the status of the daemon."""
        self._delivery.put_state(topics.status(self._config.device), payload)

    async def flush(self, timeout: float) -> None:
        """Wait until all rows are delivered, at most `timeout` seconds and only while connected."""
        await self._connector.flush(timeout)

    def close(self) -> None:
        """Leave what waits on disk for the next start."""
        waiting = len(self._spool)
        try:
            unwritten = self._spool.close()
        except OSError as error:
            _log.error("spool: not closed properly: %s", error.strerror)
            unwritten = 0
        if waiting - unwritten:
            _log.info("%d rows wait in the spool for the next start", waiting - unwritten)
        if unwritten and self._folder is not None:
            _log.error("%d rows were not delivered and are lost: the disk of the spool takes nothing", unwritten)
        elif unwritten:
            _log.warning("%d rows were not delivered and are lost: a state_dir would have kept them", unwritten)

    def counters(self) -> TelemetryCounters:
        """Counts and the state of the spool now; in the event loop only."""
        spool, delivery, connector = self._spool, self._delivery, self._connector
        return TelemetryCounters(
            rows=spool.accepted,
            delivered=delivery.delivered,
            dropped=spool.dropped,
            resent=delivery.resent,
            waiting=len(spool),
            receipts_outstanding=delivery.outstanding if self._config.spool.until == "stored" else 0,
            spool_bytes=spool.size,
            spool_limit_bytes=spool.max_bytes,
            spool_age_s=round(spool.age_s, 3),
            damaged_bytes=spool.damaged_bytes,
            disk_trouble=spool.trouble,
            reading_trouble=spool.reading_trouble,
            unreceipted_s=round(delivery.unreceipted_s, 3),
            connected=connector.state == "connected",
            broker_trouble=connector.trouble,
            reconnects=max(connector.reconnects, 0),
            sink_seen=delivery.sink_seen,
        )

    async def _sync(self) -> None:
        """Make the rows of the last second safe from power loss, in a thread: a disk may take its time."""
        while True:
            begun, self.latest = time.monotonic(), self.counters()
            self._watch_for_sinks()
            try:
                await asyncio.to_thread(confirm, self._spool.unconfirmed())
                self._sync_failed = False
            except OSError as error:
                if not self._sync_failed:
                    _log.error("spool: the disk does not confirm rows (%s)", error.strerror)
                self._sync_failed = True
            await asyncio.sleep(max(0.0, begun + _SYNC_S - time.monotonic()))

    def _watch_for_sinks(self) -> None:
        """Say once that rows wait for a sink that does not come."""
        now = time.monotonic()
        if self._connector.state != "connected" or self._delivery.sink_seen or self._config.spool.until != "stored":
            self._alone_since = now
        elif not self._warned and now - self._alone_since > _NO_SINK_S:
            self._warned = True
            _log.warning(
                "no sink has been seen: rows are published, and wait in the spool until a sink has stored them; "
                'where there are only subscribers, set [spool] until = "acknowledged"'
            )
