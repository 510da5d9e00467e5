"""`acqd sidecar`: waits for logs, works through them, publishes what is stored."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import Callable
from pathlib import Path
from typing import Any

import orjson
import paho.mqtt.client as paho
import sqlalchemy as sa

from acqd.errors import InputError, UserError
from acqd.sidecar.contents import ChangedError, Contents
from acqd.sidecar.folder_watch import FolderWatch
from acqd.sidecar.late_logs import LateLogs
from acqd.sidecar.live import Live
from acqd.sidecar.log_arrivals import Arrivals
from acqd.sidecar.log_file import printable
from acqd.sidecar.power_rows import PowerRowsMissingError
from acqd.sidecar.result import log_result
from acqd.sidecar.store import Done, Store
from acqd.sidecar.stored_outbox import StoredOutbox
from acqd.sidecar.worker import Worker
from acqd.storage.database import first_line
from acqd.telemetry.connector import Connector
from acqd.telemetry.mqtt import BrokerAddress

_log = logging.getLogger(__name__)
_MEMORY = "sidecar"
_TICK_S = 0.1
_DATABASE_RETRY_S = 2.0
_ALIVE_S = 5.0


async def _keep_alive(alive: Callable[[], None]) -> None:
    """Reports that the loop is alive, however long one log takes."""
    while True:
        alive()
        await asyncio.sleep(_ALIVE_S)


class Sidecar:
    """One folder, one model, one database; without `broker`, nothing is published."""

    def __init__(
        self,
        folder: Path,
        worker: Worker,
        store: Store,
        broker: BrokerAddress | None,
        device: str,
        *,
        live: bool,
        retry_refused: bool = False,
        report: Callable[[dict[str, Any]], None] = lambda _: None,
    ) -> None:
        """`report` gets the message of each log once it is stored. Raises UserError when `folder` is not a folder."""
        if not folder.is_dir():
            raise UserError(f"{folder} is not a folder; make it, or name the one where the robot's logs arrive")
        self._worker, self._store = worker, store
        self._broker, self._device, self._live = broker, device, live
        self._arrivals, self._contents, self._watch = Arrivals(folder), Contents(folder), FolderWatch(folder)
        self._outbox = StoredOutbox(store, f"acqd/{device}/prediction", f"acqd/{device}/prediction/alarm")
        self._late = LateLogs()
        self._retry_refused, self._report = retry_refused, report
        self.done = 0
        self.refused = 0

    async def run(self, stop: asyncio.Event, alive: Callable[[], None], *, until_idle: bool = False) -> None:
        """Runs until `stop`; with `until_idle`, until every log in the folder is done and published."""
        self._worker.restore(await asyncio.to_thread(self._store.memory, _MEMORY))
        tasks = [asyncio.create_task(self._watch.run(stop)), asyncio.create_task(_keep_alive(alive))]
        connector = self._connector()
        if connector is not None:
            tasks.append(asyncio.create_task(connector.run()))
        client = self._live_client()
        try:
            while not stop.is_set():
                worked = await self._work(stop, until_idle=until_idle)
                for task in tasks:
                    if task.done() and task.exception() is not None:
                        raise task.exception() or UserError("a task ended")
                if until_idle and not worked and not self._arrivals.waiting() and self._all_published():
                    break
                if not worked:
                    await (self._watch.pause(stop, _TICK_S) if self._arrivals.waiting() else self._watch.pause(stop))
        finally:
            if client is not None:
                client.loop_stop()
            for task in tasks:
                task.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await asyncio.gather(*tasks, return_exceptions=True)

    @property
    def waiting(self) -> int:
        """Logs whose power rows have not arrived; the next start tries them again."""
        return len(self._late)

    def _all_published(self) -> bool:
        return self._broker is None or not len(self._outbox)

    async def _work(self, stop: asyncio.Event, *, until_idle: bool) -> int:
        count = 0
        due = [] if until_idle else self._late.due()  # until idle, a log is tried once
        arrived = await asyncio.to_thread(lambda: list(self._arrivals.look()))
        for path in arrived:  # all contents first: only then a renamed log differs from one that was written again
            await self._read(path)
        for path in dict.fromkeys([*(path for path in arrived if path in self._contents), *due]):
            if stop.is_set():
                break
            try:
                count += await self._take(path)
            except sa.exc.DBAPIError as error:
                self._arrivals.forget(path)  # it arrives again when the database is back
                _log.error("%s: not stored (%s); trying again", path.name, first_line(error))
                await asyncio.sleep(_DATABASE_RETRY_S)
                count += 1
        return count

    async def _read(self, path: Path) -> bool:
        try:
            await asyncio.to_thread(self._contents.read, path)
        except (OSError, InputError) as error:
            self._give_back(path, error)
            return False
        return True

    def _give_back(self, path: Path, error: Exception) -> None:
        """A file that cannot be read now may arrive again."""
        reason = error.strerror if isinstance(error, OSError) else "has changed"
        _log.warning("%s: %s", printable(str(path)), reason)
        self._arrivals.forget(path)
        self._late.forget(path)  # it was removed while its power rows were late

    async def _take(self, path: Path) -> int:
        """Works through a log unless it is done, and stores it; 1 if it was stored.

        Raises sqlalchemy.exc.DBAPIError; nothing of the log is kept then.
        """
        if path in self._late and not await self._read(path):
            return 0
        sha256, name = self._contents[path], self._contents.name(path)
        status = await asyncio.to_thread(self._store.status, sha256)
        if status == "ok" or (status == "refused" and not self._retry_refused):
            self._late.forget(path)
            return 0
        before = self._worker.memory()
        try:
            done = await asyncio.to_thread(self._worked_through, path, name, sha256)
        except (OSError, ChangedError) as error:
            self._give_back(path, error)
            return 0
        except sa.exc.DBAPIError:
            self._worker.restore(before)
            raise
        except PowerRowsMissingError as error:
            if self._late.postpone(path):
                _log.warning("%s; trying again", error)
                return 0
            done = self._worker.refusal(name, sha256, str(error))
        self._late.forget(path)
        memory, elsewhere = {_MEMORY: self._worker.memory()}, self._contents.elsewhere(path)
        try:
            await asyncio.to_thread(self._store.commit, done, memory, elsewhere)
        except sa.exc.DBAPIError:
            self._worker.restore(before)
            raise
        self._outbox.wake()
        self._report(done.message)
        self.done += done.status == "ok"
        self.refused += done.status == "refused"
        log_result(done)
        return 1

    def _worked_through(self, path: Path, name: str, sha256: str) -> Done:
        """Raises PowerRowsMissingError, OSError, ChangedError, sqlalchemy.exc.DBAPIError."""
        if reason := self._contents.refusal(path):
            return self._worker.refusal(name, sha256, f"{path.name}: {reason}")
        with self._contents.open(path) as file:
            return self._worker.run(path, file, name, sha256)

    def _connector(self) -> Connector | None:
        if self._broker is None:
            return None
        return Connector(
            self._broker, self._outbox, client_id=f"acqd-sidecar-{self._device}",
            status_topic=f"acqd/{self._device}/prediction/status",
            greeting=lambda: orjson.dumps({"model": self._worker.name}),
        )  # fmt: skip

    def _live_client(self) -> paho.Client | None:
        if not self._live or self._broker is None:
            return None
        live = Live(self._worker.model, f"acqd/{self._device}/joints", f"acqd/{self._device}/prediction/live")
        return live.connect(self._broker, f"acqd-sidecar-live-{self._device}")
