"""Publishes the rows of a playback from synchronous code."""

from __future__ import annotations

import asyncio
import contextlib
import queue
import threading
import time
from types import TracebackType

from acqd.errors import UserError
from acqd.telemetry import topics
from acqd.telemetry.connector import Connector
from acqd.telemetry.delivery import Delivery
from acqd.telemetry.mqtt import BrokerAddress
from acqd.telemetry.row import PowerRow
from acqd.telemetry.spool import Spool, SpooledRow, Stream

_WAITING = 2_000  # messages in flight before the playback waits for the broker: nothing is dropped


class Publisher:
    """A connector in a separate thread. When the broker is slow, `publish` waits instead of dropping rows."""

    def __init__(self, address: BrokerAddress, device: str) -> None:
        self._address, self._device = address, device
        self._loop = asyncio.new_event_loop()
        self._failure: Exception | None = None
        self._ready = threading.Event()
        self._thread = threading.Thread(target=self._serve, name="publisher", daemon=True)

    def __enter__(self) -> Publisher:
        self._thread.start()
        self._ready.wait()
        while self._failure is None and self._connector.state != "connected":
            time.sleep(0.01)
        if self._failure is not None:
            self._close()
            raise self._failure
        return self

    def publish(self, rows: list[PowerRow]) -> None:
        """Hand over rows; waits while too many are in flight."""
        spooled = [SpooledRow(Stream(row.device, row.channel, row.boot), row.seq, row.to_json()) for row in rows]
        for start in range(0, len(spooled), _WAITING):
            self._wait_for(_WAITING)
            self._loop.call_soon_threadsafe(self._outbox.put_rows, spooled[start : start + _WAITING])

    def __exit__(self, kind: type[BaseException] | None, _error: object, _trace: TracebackType | None) -> None:
        if kind is None:
            self._wait_for(0)
        self._close()

    def _wait_for(self, waiting: int) -> None:
        """Wait until at most `waiting` messages are left. Raises UserError when the broker takes none for 30 s."""
        progress, since = self._connector.delivered, time.monotonic()
        while (left := self._left()) > waiting:
            if self._connector.delivered != progress:
                progress, since = self._connector.delivered, time.monotonic()
            elif time.monotonic() - since > 30:
                raise UserError(f"broker {self._address} takes no messages any more; {left} rows wait")
            time.sleep(0.002)

    def _left(self) -> int:
        """Rows that wait, counted in the thread that delivers them. Raises what has ended that thread."""
        counted: queue.SimpleQueue[int] = queue.SimpleQueue()
        with contextlib.suppress(RuntimeError):  # the loop has ended; the reason follows
            self._loop.call_soon_threadsafe(lambda: counted.put(len(self._outbox)))
        while True:
            if self._failure is not None:
                raise self._failure
            with contextlib.suppress(queue.Empty):
                return counted.get(timeout=0.1)

    def _serve(self) -> None:
        asyncio.set_event_loop(self._loop)
        self._loop.run_until_complete(self._run())
        self._loop.close()

    async def _run(self) -> None:
        try:
            self._outbox = Delivery(Spool(None), "acknowledged", live=False)
            self._connector = Connector(
                self._address,
                self._outbox,
                client_id=f"acqd-replay-{self._device}",
                status_topic=topics.status(self._device),
                greeting=lambda: b'{"state":"online","source":"replay"}',
                must_connect=True,
            )
            self._task = asyncio.create_task(self._connector.run())
        except UserError as error:
            self._failure = error
            return
        finally:
            self._ready.set()
        try:
            await self._task
        except asyncio.CancelledError:
            return
        except Exception as error:  # raised in the thread that waits for this one
            self._failure = error

    def _close(self) -> None:
        if not self._loop.is_closed():
            with contextlib.suppress(RuntimeError):  # the loop has just closed by itself
                self._loop.call_soon_threadsafe(self._task.cancel)
        self._thread.join(5)
