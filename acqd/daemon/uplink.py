"""From rows to the broker: spool, delivery and connector of one daemon."""

from __future__ import annotations

import asyncio
import logging
import time
import uuid
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import orjson

from acqd.changes import StateLog
from acqd.daemon.config import Config
from acqd.daemon.instance import claimant
from acqd.daemon.register import RegisterFile, Run
from acqd.daemon.rights_watch import RightsWatch
from acqd.telemetry import topics
from acqd.telemetry.ask import Claimant
from acqd.telemetry.connector import Connector
from acqd.telemetry.counters import TelemetryCounters
from acqd.telemetry.delivery import Delivery
from acqd.telemetry.dialogue import Dialogue
from acqd.telemetry.event import PowerEvent
from acqd.telemetry.last_rows import Known, LastRows
from acqd.telemetry.name import Name
from acqd.telemetry.quality_row import QualityRow
from acqd.telemetry.receipts import LastRow
from acqd.telemetry.register_row import OnceAMinute, register_row
from acqd.telemetry.register_witness import RegisterWitness
from acqd.telemetry.row import PowerRow, parse_row
from acqd.telemetry.spool import Readings, Spool, SpooledRow, Stream, confirm
from acqd.telemetry.spool.left_behind import folder_of, left_behind, strangers

_log = logging.getLogger(__name__)
_SYNC_S = 0.8  # at most 1 s of rows is at risk when the power fails
_NO_SINK_S = 60.0
_LEFT_BEHIND_S, _STRANGERS_S = 60.0, 5.0
"""Spools of other names change when somebody starts a daemon there."""
_ANSWER_S, _LOOK_S = 5.0, 1.0
"""How long the first row waits for a sink that knows the last rows before it: after a power cut; after a run that has
not ended and whose registers are not of its end."""


class Uplink:
    """Keeps rows until they are delivered, and delivers them."""

    def __init__(
        self, config: Config, devices: Sequence[str], status: Callable[[], bytes], me: Claimant | None = None
    ) -> None:
        """`devices`: those whose rows will come; `me`: this run. Raises UserError when the spool cannot be used."""
        self._config = config
        folder = folder_of(config.state_dir, config.device) if config.state_dir is not None else None
        self._spool = Spool(folder, config.spool.limits())
        me = me or claimant(config.state_dir, uuid.uuid4().hex[:12], take_name=False)
        self.name = Name(me)
        self._unfinished = _unfinished(config.state_dir, devices)
        boots = {name: run.boot.partition(".")[0] for name, run in self._unfinished.items()}
        self._last_rows = LastRows(boots, sinks=lambda: self._delivery.sinks)
        self._registers = RegisterWitness(devices if config.state_dir is not None else ())
        greet = partial(self._put_greeting, status)
        self.started: list[asyncio.Task[None]] = []
        self._delivery = Delivery(
            self._spool,
            config.spool.until,
            devices,
            windows=config.mqtt.rows == "window",
            dialogue=Dialogue(config.device, self.name, self._last_rows, self._registers, greet),
        )
        self._connector = Connector(
            config.mqtt.address(),
            self._delivery,
            client_id=f"acqd-{config.device}-{me.boot}",
            status_topic=topics.status(config.device),
            greeting=lambda: status() if self.name.held else None,
        )
        self._rights = RightsWatch(config, self._delivery, self._connector, me)
        self._says = StateLog(_log)
        self._folder = folder
        self._register_times = OnceAMinute()
        self._sync_trouble, self._warned = "", False
        self._left_behind = ""
        self._cuts: dict[str, bool] = {}
        self._alone_since = time.monotonic()
        self.latest = self.counters()
        """The counters, at most a second old; for other threads than the event loop's."""

    def readings(self, device: str) -> Readings | None:
        """A device's registers after the last row that an earlier start has spooled."""
        before = self._spool.readings("") if device == self._config.device else None
        return self._spool.readings(device) or before

    async def last_rows(self, device: str) -> Known | None:
        """What a sink and the broker know of the last rows of a run that did not end; None: there was no such run."""
        self.tasks()
        self._delivery.say()
        cut = device in self._unfinished and self._unfinished[device].cut_off
        known = await self._last_rows.of(device, _ANSWER_S if cut else _LOOK_S)
        if cut:
            self._cuts[device] = known is not None and known.answered
        return known

    def unread(self, device: str) -> list[LastRow]:
        """The last row of each channel that an earlier start has spooled without the registers after it."""
        rows = []
        for stream, seq, payload in self._spool.unread(device):
            with suppress(ValueError):  # what no acqd has written
                if not topics.travels_alone(stream.channel) and (W := parse_row(payload).W) is not None:
                    rows.append(LastRow(stream.channel, stream.boot, seq, W))
        return rows

    def tasks(self) -> list[asyncio.Task[None]]:
        """Start to deliver, once; the tasks do not end by themselves."""
        if self.started:
            return self.started
        if self._folder is None:
            _log.info("no state_dir: rows that are not delivered wait in memory only")
        tasks = [asyncio.create_task(self._connector.run()), asyncio.create_task(self._sync())]
        if self._config.state_dir is not None:
            tasks.append(asyncio.create_task(self._watch_other_names(self._config.state_dir)))
        if not self._config.broker.embedded:  # that one has no access rules
            self._delivery.doubt()
            tasks.append(asyncio.create_task(self._rights.watch()))
        self.started = tasks
        return tasks

    def put(self, rows: Sequence[PowerRow], summaries: Sequence[dict[str, Any]], readings: Readings | None) -> None:
        """Take the rows of a window, and the summaries that they complete."""
        self._delivery.put_rows(
            [SpooledRow(Stream(row.device, row.channel, row.boot), row.seq, row.to_json()) for row in rows], readings
        )
        for summary in summaries:
            self._registers.began(summary)
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

    def _put_greeting(self, status: Callable[[], bytes]) -> None:
        self.put_status(status())
        self._delivery.say()

    async def flush(self, timeout: float) -> None:
        """Wait until all rows are delivered, at most `timeout` seconds and only while connected."""
        begun = time.monotonic()
        await self._connector.flush(timeout)
        if self._config.spool.until == "acknowledged" and not self._config.broker.embedded:
            with suppress(TimeoutError):
                await asyncio.wait_for(self._rights.ask_at_last(), max(0.5, timeout - (time.monotonic() - begun)))

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
            disk_trouble=spool.trouble or self._sync_trouble,
            reading_trouble=spool.reading_trouble,
            left_behind=self._left_behind,
            deleted=spool.deleted,
            registers_back=self._registers.trouble,
            cuts=len(self._cuts),
            cuts_unconfirmed=sum(not answered for answered in self._cuts.values()),
            unreceipted_s=round(delivery.unreceipted_s, 3),
            receipt_lag_s=round(delivery.receipt_lag_s, 3),
            alone_s=round(delivery.alone_s, 3),
            connected=connector.state == "connected",
            broker_trouble=self.name.trouble or connector.trouble,
            certificate=connector.certificate,
            rights_trouble=self._rights.trouble,
            clock_trouble=delivery.clock_trouble,
            reconnects=max(connector.reconnects, 0),
            gone_back=delivery.gone_back,
            sink_seen=delivery.sink_seen,
        )

    async def _sync(self) -> None:
        """Make the rows of the last second safe from power loss, in a thread: a disk may take its time."""
        changed: set[Path] = set()
        while True:
            begun, self.latest = time.monotonic(), self.counters()
            self._watch_for_sinks()
            self._say_name()
            try:
                changed |= self._spool.unconfirmed()
                await asyncio.to_thread(confirm, changed)
                changed, self._sync_trouble = set(), ""
            except OSError as error:
                if not self._sync_trouble:
                    _log.error("spool: the disk does not confirm rows (%s)", error.strerror)
                self._sync_trouble = f"the disk does not confirm rows: {error.strerror}"
            await asyncio.sleep(max(0.0, begun + _SYNC_S - time.monotonic()))

    async def _watch_other_names(self, state_dir: Path) -> None:
        """Name rows that nobody delivers: under another name, as where the device was renamed, or in copies."""
        mine, others, look_at = folder_of(state_dir, self._config.device), None, -1e9
        while True:
            if time.monotonic() - look_at > _LEFT_BEHIND_S:
                look_at = time.monotonic()
                others = await asyncio.to_thread(left_behind, state_dir, self._config.device)
            found = others or await asyncio.to_thread(strangers, mine)
            self._left_behind = "" if found is None else str(found)
            if found is not None:
                self._says.trouble("spool", self._left_behind, self._left_behind)
            else:
                self._says.fine("spool", "no rows wait under another name or in copies any more")
            await asyncio.sleep(_STRANGERS_S)

    def _say_name(self) -> None:
        if trouble := self.name.trouble:
            self._says.trouble("device name", trouble, trouble)
        else:
            self._says.fine("device name", "nobody else uses it any more")

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


def _unfinished(state_dir: Path | None, devices: Sequence[str]) -> dict[str, Run]:
    """Devices whose last run may have sent rows whose energy no disk has."""
    runs = {} if state_dir is None else {device: RegisterFile(state_dir, device).unfinished() for device in devices}
    return {device: run for device, run in runs.items() if run is not None}
