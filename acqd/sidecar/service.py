"""`acqd sidecar`: waits for logs, works through them, publishes what is stored."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import orjson
import paho.mqtt.client as paho
import sqlalchemy as sa
from watchfiles import awatch

from acqd.errors import UserError
from acqd.sidecar.arrivals import Arrivals
from acqd.sidecar.live import Live
from acqd.sidecar.store import Store, StoredOutbox
from acqd.sidecar.work import NoPowerYetError, Worker, hash_of, printable
from acqd.telemetry.connector import Connector
from acqd.telemetry.mqtt import BrokerAddress

_log = logging.getLogger(__name__)
_MEMORY = "sidecar"
_TICK_S = 0.1
_IDLE_S = 2.0
"""Between looks when nothing has been told of: network shares tell of nothing."""
_ALIVE_S = 5.0
_NOTEWORTHY = 0.02  # of a log
_RETRY_S, _GIVE_UP_S = 30.0, 12 * 3600.0
"""Power rows may come late: the sink catches up after an outage."""


@dataclass(slots=True)
class _Late:
    """A log whose power rows have not arrived."""

    end_s: float
    """Monotonic: when it is given up."""
    next_s: float = 0.0


async def _tell(alive: Callable[[], None]) -> None:
    """The loop is alive, however long a log takes."""
    while True:
        alive()
        await asyncio.sleep(_ALIVE_S)


class Sidecar:
    """One folder, one model, one database; `broker` None publishes nothing."""

    def __init__(
        self,
        folder: Path,
        worker: Worker,
        store: Store,
        broker: BrokerAddress | None,
        device: str,
        *,
        live: bool,
        again: bool = False,
        tell: Callable[[dict[str, Any]], None] = lambda _: None,
    ) -> None:
        """`again`: refused logs are looked at once more; `tell` gets what is stored of each log.

        Raises UserError when the folder is none.
        """
        if not folder.is_dir():
            raise UserError(f"{folder} is no folder; make it, or name the one where the robot's logs arrive")
        self._folder, self._worker, self._store = folder, worker, store
        self._broker, self._device, self._live = broker, device, live
        self._arrivals = Arrivals(folder)
        self._outbox = StoredOutbox(store, f"acqd/{device}/prediction", f"acqd/{device}/prediction/alarm")
        self._changed = asyncio.Event()
        self._late: dict[Path, _Late] = {}
        self._content: dict[Path, str] = {}
        """SHA-256 of every file that was seen."""
        self._again, self._tell = again, tell
        self.done = 0
        self.refused = 0

    async def run(self, stop: asyncio.Event, alive: Callable[[], None], *, until_idle: bool = False) -> None:
        """Until `stop`; with `until_idle`, until every log in the folder is done and published."""
        self._worker.restore(await asyncio.to_thread(self._store.memory, _MEMORY))
        tasks = [asyncio.create_task(self._watch(stop)), asyncio.create_task(_tell(alive))]
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
                if until_idle and not worked and not self._arrivals.waiting() and self._all_told():
                    break
                if not worked:
                    await self._pause(stop)
        finally:
            if client is not None:
                client.loop_stop()
            for task in tasks:
                task.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await asyncio.gather(*tasks, return_exceptions=True)

    def _all_told(self) -> bool:
        return self._broker is None or not len(self._outbox)

    @property
    def waiting(self) -> int:
        """Logs whose power has not arrived: the next start looks at them again."""
        return len(self._late)

    async def _work(self, stop: asyncio.Event, *, until_idle: bool) -> int:
        count = 0
        now = time.monotonic()
        due = [path for path, late in self._late.items() if now >= late.next_s and not (until_idle and late.next_s)]
        arrived = await asyncio.to_thread(lambda: list(self._arrivals.look()))
        for path in arrived:  # all of them first: a log that was renamed is told from one that was written again
            await self._read(path)
        for path in dict.fromkeys([*(path for path in arrived if path in self._content), *due]):
            if stop.is_set():
                break
            try:
                count += await self._take(path)
            except sa.exc.DatabaseError as error:
                self._arrivals.forget(path)  # looked at again when the database is back
                _log.error("%s: not stored (%s); trying again", path.name, str(error.orig).strip().splitlines()[0])
                await asyncio.sleep(_IDLE_S)
                count += 1
        return count

    async def _read(self, path: Path) -> bool:
        try:
            self._content[path] = await asyncio.to_thread(hash_of, path)
        except OSError as error:
            _log.warning("%s: %s", printable(str(path)), error.strerror)
            self._content.pop(path, None)
            self._arrivals.forget(path)
            self._late.pop(path, None)  # it was taken away while its power was waited for
            return False
        return True

    def _elsewhere(self, path: Path) -> Callable[[str], str | None]:
        """Name of another file that holds a content."""
        others = {sha256: other for other, sha256 in self._content.items() if other != path and other.exists()}
        return lambda sha256: self._name(others[sha256]) if sha256 in others else None

    def _name(self, path: Path) -> str:
        return printable(path.relative_to(self._folder).as_posix())

    async def _take(self, path: Path) -> int:
        """Raises sqlalchemy.exc.DatabaseError; nothing of the log is kept then."""
        if path in self._late and not await self._read(path):
            return 0
        sha256 = self._content[path]
        status = await asyncio.to_thread(self._store.status, sha256)
        if status == "ok" or (status == "refused" and not self._again):
            self._late.pop(path, None)
            return 0
        before = self._worker.memory()
        name = self._name(path)
        try:
            done = await asyncio.to_thread(self._worker.run, path, name, sha256)
        except NoPowerYetError as error:
            late = self._late.setdefault(path, _Late(time.monotonic() + _GIVE_UP_S))
            late.next_s = time.monotonic() + _RETRY_S
            if time.monotonic() < late.end_s:
                _log.warning("%s; trying again", error)
                return 0
            done = self._worker.refusal(name, sha256, str(error))
        self._late.pop(path, None)
        try:
            await asyncio.to_thread(self._store.commit, done, {_MEMORY: self._worker.memory()}, self._elsewhere(path))
        except sa.exc.DatabaseError:
            self._worker.restore(before)
            raise
        self._outbox.wake()
        self._tell(done.message)
        self.done += done.status == "ok"
        self.refused += done.status == "refused"
        if done.status == "refused":
            _log.warning("%s", done.message["reason"])
        else:
            missing = 1 - done.message["covered"]
            aside = f"; {missing:.0%} of it could not be compared" if missing > _NOTEWORTHY else ""
            _log.info("%s: residual %.2f W RMS%s", done.name, done.message["rmse_W"], aside)
        if done.message.get("alarm"):
            _log.warning("the residual has changed: %s", orjson.dumps(done.message["alarm"]).decode())
        return 1

    async def _watch(self, stop: asyncio.Event) -> None:
        while not stop.is_set():
            try:
                async for _ in awatch(self._folder, stop_event=stop, step=20, debounce=50):
                    self._changed.set()
            except Exception as error:  # a name that is no UTF-8, too many watches: looking now and then does, too
                reason = error.exceptions[0] if isinstance(error, BaseExceptionGroup) else error
                _log.warning("%s: nothing is told of new files (%s), looking for them", self._folder, reason)
                await asyncio.sleep(_IDLE_S)

    async def _pause(self, stop: asyncio.Event) -> None:
        """Short while a file is being written; else until something changes, or a look is due anyway."""
        self._changed.clear()
        waits = [asyncio.create_task(self._changed.wait()), asyncio.create_task(stop.wait())]
        await asyncio.wait(
            waits, timeout=_TICK_S if self._arrivals.waiting() else _IDLE_S, return_when=asyncio.FIRST_COMPLETED
        )
        for each in waits:
            each.cancel()

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
