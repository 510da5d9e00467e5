"""One `acqd run` from start to SIGTERM: feed, telemetry and, if configured, broker and sink."""

from __future__ import annotations

import asyncio
import logging
import os
import signal
import time
import uuid
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

import orjson
from msgspec import to_builtins

from acqd import __version__
from acqd.daemon.archive.of_daemon import archive_of
from acqd.daemon.broker_process import BrokerProcess
from acqd.daemon.config import Config
from acqd.daemon.embedded_child import EmbeddedChild
from acqd.daemon.feed import Company, Feed
from acqd.daemon.feeds import feed_of
from acqd.daemon.health.daemon import DaemonHealth, Progress
from acqd.daemon.health.snapshot import Archive, Delivery, Link
from acqd.daemon.instance import claimant
from acqd.daemon.notify import notify
from acqd.daemon.tape import Tape
from acqd.daemon.uplink import Uplink
from acqd.errors import UserError
from acqd.telemetry import certificates
from acqd.telemetry.counters import TelemetryCounters
from acqd.telemetry.row import PowerRow
from acqd.telemetry.spool import Readings
from acqd.timestamps import rfc3339

_log = logging.getLogger(__name__)
_STATUS_S = 10.0
_SAVE_S = 1.0
_FLUSH_S = 0.6  # of the 2 s that a stop may take


class Service:
    """The running daemon."""

    def __init__(
        self,
        config: Config,
        on_second: Callable[[list[dict[str, Any]]], None] | None = None,
        tape: Tape | None = None,
        *,
        take_name: bool = False,
    ) -> None:
        """`on_second` receives the 1 s summaries of all channels (live numbers in a terminal), `tape` all rows.

        `take_name`: another daemon of this name is to stop publishing.
        """
        self._tape = tape
        self.config = config
        self._on_second = on_second
        self._boot = uuid.uuid4().hex[:12]
        if config.state_dir is not None:
            _make_folder(config.state_dir)
        self._me = claimant(config.state_dir, self._boot, take_name=take_name)
        self._uplink = Uplink(config, config.devices, self._status, self._me) if config.mqtt.enabled else None
        quality = self._uplink.put_quality if self._uplink else None
        announce = self._uplink.put_event if self._uplink else None
        self._archive = archive_of(config)
        company = Company(archive=self._archive)
        self._feed: Feed = feed_of(config, self._boot, self._take, self._uplink, quality, announce, company)
        self._stop = asyncio.Event()
        self._started = time.time_ns()
        self._health = DaemonHealth(config.health, config.device, self._feed, self._progress, config.mqtt.certificates)
        self._metering = False
        self.rows = 0

    async def run(self, duration: float | None = None) -> None:
        """Meter until SIGTERM, SIGINT, the source's end or `duration` [s]. Raises UserError when it cannot start."""
        loop = asyncio.get_running_loop()
        for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
            loop.add_signal_handler(number, self._stop.set)
        broker = BrokerProcess(self.config.broker.host, self.config.mqtt.port) if self.config.broker.embedded else None
        sink = EmbeddedChild("sink", self.config) if self.config.sink.embedded else None
        page = EmbeddedChild("web", self.config) if self.config.web.enabled else None
        background: list[asyncio.Task[None]] = []
        try:
            if broker is not None:
                await broker.start()
            if sink is not None:
                await sink.start()
            await self._feed.start()
            if self._uplink is not None:
                background += self._uplink.tasks()
            self._metering = True
            for sentence in self._feed.refused:
                _log.warning("real time: %s", sentence)
            metering = asyncio.create_task(self._feed.run())
            background.append(asyncio.create_task(self._housekeeping()))
            if sink is not None:
                background.append(asyncio.create_task(sink.watch()))
            if page is not None:
                background.append(asyncio.create_task(page.keep()))
            self._health.start()
            notify(f"READY=1\nSTATUS=metering {self.config.device}")
            await self._until_done(metering, background, duration)
        finally:
            notify("STOPPING=1")
            self._health.stop()
            if self._uplink is not None and not background:  # a feed that asked what is stored, and could not start
                background += self._uplink.started
            await self._shut_down(background, broker, [each for each in (page, sink) if each is not None])

    async def _until_done(
        self, metering: asyncio.Task[None], background: list[asyncio.Task[None]], duration: float | None
    ) -> None:
        """Wait for the source's end, a stop, `duration` [s] or the end of a background task, whichever comes first."""
        stopping = asyncio.create_task(self._stop.wait())
        done, _ = await asyncio.wait(
            {metering, stopping, *background}, timeout=duration, return_when=asyncio.FIRST_COMPLETED
        )
        stopping.cancel()
        if not metering.done():
            await self._feed.stop()
        await metering
        for task in done & set(background):
            task.result()  # the embedded sink has ended, or a bug

    async def _shut_down(
        self,
        background: list[asyncio.Task[None]],
        broker: BrokerProcess | None,
        children: list[EmbeddedChild],
    ) -> None:
        """Stop the feed first and the broker last, so that the last rows reach the sink."""
        await self._feed.stop()
        self._feed.save()
        if self._archive is not None:
            await asyncio.to_thread(self._archive.close)
        if self._uplink is not None:
            await self._uplink.flush(_FLUSH_S)
        for task in background:
            task.cancel()
        await asyncio.gather(*background, return_exceptions=True)
        if self._uplink is not None:
            self._uplink.close()
        for child in children:
            await child.stop()
        if broker is not None:
            await broker.stop()
        self._feed.close()

    def _take(self, rows: list[PowerRow], summaries: list[dict[str, Any]], readings: Readings | None) -> None:
        """Hand rows and summaries over."""
        if self._tape is not None:
            self._tape.write(rows)
        if self._uplink is not None:
            self._uplink.put(rows, summaries, readings)
        if self._on_second is not None and summaries:
            self._on_second(summaries)
        self.rows += len(rows)

    async def _housekeeping(self) -> None:
        """Show that the event loop turns, publish the status, save the energy registers."""
        next_status = next_save = 0.0
        while True:
            now = time.monotonic()
            self._health.turned()
            if now >= next_status and self._uplink is not None:
                next_status = now + _STATUS_S
                self._uplink.put_status(self._status())
            if now >= next_save:
                next_save = now + _SAVE_S
                await asyncio.to_thread(self._feed.save)  # a disk may take its time
            await asyncio.sleep(0.5)

    def counters(self) -> TelemetryCounters | None:
        """Delivery of the rows, at most a second old; None without MQTT. May be asked in any thread."""
        return self._uplink.latest if self._uplink is not None else None

    def _progress(self) -> Progress:
        """Rows and their delivery, for the health endpoints."""
        counters = self.counters()
        archive = Archive(**asdict(self._archive.latest)) if self._archive is not None else None
        if counters is None:
            return Progress(self.rows, archive=archive)
        return Progress(
            self.rows,
            Delivery(
                delivered=counters.delivered,
                dropped=counters.dropped,
                waiting=counters.waiting,
                resent=counters.resent,
                receipts_outstanding=counters.receipts_outstanding,
                spool_bytes=counters.spool_bytes,
                spool_limit_bytes=counters.spool_limit_bytes,
                spool_age_s=counters.spool_age_s,
                disk_trouble=counters.disk_trouble,
                reading_trouble=counters.reading_trouble,
                left_behind=counters.left_behind,
                deleted=counters.deleted,
                gone_back=counters.gone_back,
                registers_back=counters.registers_back,
                cuts=counters.cuts,
                cuts_unconfirmed=counters.cuts_unconfirmed,
                unreceipted_s=counters.unreceipted_s,
                receipt_lag_s=counters.receipt_lag_s,
                alone_s=counters.alone_s,
                rights_trouble=counters.rights_trouble,
                clock_trouble=counters.clock_trouble,
                old_after_s=self.config.spool.max_age_days * 86_400.0,
            ),
            Link(
                counters.connected,
                counters.reconnects,
                counters.broker_trouble,
                certificate_trouble=certificates.near_end("of the broker", counters.certificate),
            ),
            archive,
        )

    def _status(self) -> bytes:
        return orjson.dumps(self.status())

    def status(self) -> dict[str, Any]:
        """The content of the status topic while the daemon is online."""
        counters = self.counters()
        return {
            "state": "online",
            "device": self.config.device,
            "boot": self._feed.health().boot if self._metering else self._boot,
            "version": __version__,
            "time": rfc3339(time.time_ns()),
            "started": rfc3339(self._started),
            "name": to_builtins(self._me),
            "rival": str(self._uplink.name.rival or "") if self._uplink is not None else "",
            "source": "several" if self.config.sources else self.config.source.kind,
            "rows": self.rows,
            "realtime_refused": self._feed.refused,
            "events": self.config.watched,
            "archive": asdict(self._archive.latest) if self._archive is not None else {},
            "mqtt": {
                "waiting": counters.waiting,
                "dropped": counters.dropped,
                "delivered": counters.delivered,
                "reconnects": counters.reconnects,
            }
            if counters
            else {},
            "spool": asdict(counters) if counters else {},
            **(self._feed.status() if self._metering else {}),
        }


def _make_folder(folder: Path) -> None:
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o750)
    except OSError as error:
        raise UserError(f"state_dir {folder} cannot be made ({error.strerror}); choose another") from None
    if not os.access(folder, os.W_OK):
        raise UserError(f"state_dir {folder} may not be written by this user; choose another or change its owner")
