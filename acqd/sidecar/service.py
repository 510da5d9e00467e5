"""`acqd sidecar`: waits for logs, works through them, publishes what is stored."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import Callable
from pathlib import Path

import orjson
import paho.mqtt.client as paho
import sqlalchemy as sa
from watchfiles import awatch

from acqd.errors import UserError
from acqd.sidecar.arrivals import Arrivals
from acqd.sidecar.live import Live
from acqd.sidecar.store import Store, StoredOutbox
from acqd.sidecar.work import Worker, hash_of
from acqd.telemetry.connector import Connector
from acqd.telemetry.mqtt import BrokerAddress

_log = logging.getLogger(__name__)
_MEMORY = "sidecar"
_TICK_S = 0.1
_IDLE_S = 2.0
"""Between looks when nothing has been told of: network shares tell of nothing."""


class Sidecar:
    """One folder, one model, one database; `broker` None publishes nothing."""

    def __init__(
        self, folder: Path, worker: Worker, store: Store, broker: BrokerAddress | None, device: str, *, live: bool
    ) -> None:
        """Raises UserError when the folder is none."""
        if not folder.is_dir():
            raise UserError(f"{folder} is no folder; make it, or name the one where the robot's logs arrive")
        self._folder, self._worker, self._store = folder, worker, store
        self._broker, self._device, self._live = broker, device, live
        self._arrivals = Arrivals(folder)
        self._outbox = StoredOutbox(store, f"acqd/{device}/prediction", f"acqd/{device}/prediction/alarm")
        self._changed = asyncio.Event()
        self.done = 0
        self.refused = 0

    async def run(self, stop: asyncio.Event, alive: Callable[[], None], *, until_idle: bool = False) -> None:
        """Until `stop`; with `until_idle`, until every log in the folder is done and published."""
        self._worker.restore(await asyncio.to_thread(self._store.memory, _MEMORY))
        tasks = [asyncio.create_task(self._watch(stop))]
        connector = self._connector()
        if connector is not None:
            tasks.append(asyncio.create_task(connector.run()))
        client = self._live_client()
        try:
            while not stop.is_set():
                alive()
                worked = await self._work()
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

    async def _work(self) -> int:
        count = 0
        for path in await asyncio.to_thread(lambda: list(self._arrivals.look())):
            count += await self._take(path)
        return count

    async def _take(self, path: Path) -> int:
        try:
            sha256 = await asyncio.to_thread(hash_of, path)
        except OSError as error:
            _log.warning("%s: %s", path, error.strerror)
            return 0
        if await asyncio.to_thread(self._store.known, sha256):
            return 0
        before = self._worker.memory()
        done = await asyncio.to_thread(self._worker.run, path, sha256)
        try:
            await asyncio.to_thread(self._store.commit, done, {_MEMORY: self._worker.memory()})
        except sa.exc.IntegrityError:
            self._worker.restore(before)  # another sidecar was faster
            return 0
        except sa.exc.DatabaseError as error:
            self._worker.restore(before)
            self._arrivals = Arrivals(self._folder)  # looked at again when the database is back
            _log.error("%s: not stored (%s); trying again", path.name, str(error.orig).strip().splitlines()[0])
            await asyncio.sleep(_IDLE_S)
            return 0
        self._outbox.wake()
        self.done += done.status == "ok"
        self.refused += done.status == "refused"
        if done.status == "refused":
            _log.warning("%s", done.message["reason"])
        else:
            _log.info("%s: residual %.2f W RMS", done.name, done.message["rmse_W"])
        if done.message.get("alarm"):
            _log.warning("the residual has changed: %s", orjson.dumps(done.message["alarm"]).decode())
        return 1

    async def _watch(self, stop: asyncio.Event) -> None:
        async for _ in awatch(self._folder, stop_event=stop, step=20, debounce=50):
            self._changed.set()

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
