"""All meters of one link, each in turn; a dead one costs the others no more than its time-out."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable

from acqd.errors import UserError
from acqd.retry import Backoff
from acqd.sources.meters.meter import Meter, MeterSettings
from acqd.sources.meters.profile import load_profile
from acqd.sources.meters.reading import Reading
from acqd.sources.modbus.client import ModbusClient, ModbusError
from acqd.sources.modbus.settings import ModbusLink

__all__ = ["MeterBus", "MeterSettings"]
_log = logging.getLogger(__name__)
_STOP_S = 3.0
_TURNAROUND_S = 0.005  # of an RS-485 line between two meters


class MeterBus:
    """Polls the meters of one link in a separate thread."""

    def __init__(self, link: ModbusLink, meters: list[MeterSettings]) -> None:
        """Raises UserError for an unknown profile or a unit id that two meters share."""
        self.link = link
        self.meters = [Meter(settings, load_profile(settings.profile)) for settings in meters]
        units = [meter.unit for meter in self.meters]
        for unit in units:
            if units.count(unit) > 1:
                raise UserError(f"source.meters: two meters on {link} have the unit id {unit}; give each its own")
        self._client: ModbusClient | None = None
        self._backoff = Backoff()
        self._stopping = threading.Event()
        self._thread: threading.Thread | None = None
        self.failure = ""
        """What ended the bus's thread although nobody had called `stop`; one line."""

    def check(self) -> None:
        """Read every meter once; a silent one has its `trouble`.

        Raises UserError when no meter answers, or one makes no sense.
        """
        self._client = ModbusClient(self.link)
        silent = []
        for meter in self.meters:
            try:
                meter.check(self._client)
            except ModbusError as error:
                meter.trouble = str(error)
                silent.append(f"meter {meter.settings.name!r}: {error}")
        if len(silent) == len(self.meters):
            self._close()
            here = ', databits, framing (some lines need "ascii")' if self.link.host is None else ""
            gateway = (
                ""
                if self.link.is_serial
                else '; a gateway that passes serial frames on needs framing = "rtu" or "ascii"'
            )
            raise UserError(
                f"{self.link}: no meter answers ({silent[0]}); "
                f"check wiring, baud rate, parity{here} and unit ids{gateway}"
            )

    def start(self, on_reading: Callable[[Reading], None]) -> None:
        """Poll until `stop`; `on_reading` is called in the bus's thread. May be called again when that has ended."""
        self._thread = threading.Thread(target=self._poll, args=(on_reading,), name=f"bus {self.link}", daemon=True)
        self._thread.start()

    @property
    def polling(self) -> bool:
        """Whether the bus's thread lives."""
        return self._thread is not None and self._thread.is_alive()

    def stop(self) -> None:
        """End the polling; waits for the round that is under way, not for ever."""
        self._stopping.set()
        if self._thread is None:
            self._close()
        else:
            self._thread.join(_STOP_S)

    def _poll(self, on_reading: Callable[[Reading], None]) -> None:
        """The thread: it alone uses the connection once it runs."""
        try:
            try:
                self._poll_in_turn(on_reading)
            finally:
                self._close()
        except BaseException as error:  # whatever it is, it ends this thread, and nothing else
            self.failure = f"{type(error).__name__}: {error}".rstrip(": ").splitlines()[0]
            _log.debug("%s", self._thread, exc_info=True)

    def _poll_in_turn(self, on_reading: Callable[[Reading], None]) -> None:
        while not self._stopping.is_set():
            meter = min(self.meters, key=lambda one: one.next_due_ns)
            wait_s = (meter.next_due_ns - time.monotonic_ns()) * 1e-9
            if wait_s > 0 and self._stopping.wait(wait_s):
                return
            if not self._connected():
                continue
            assert self._client is not None
            reading = meter.read(self._client, time.monotonic_ns(), time.time_ns)
            if reading is not None:
                on_reading(reading)
            elif all(one.trouble for one in self.meters):
                self._close()  # silence everywhere is the line's: a fresh connection is worth a try
            self._stopping.wait(_TURNAROUND_S)

    def _connected(self) -> bool:
        if self._client is None:
            if not self._backoff.due(time.monotonic_ns()):
                self._stopping.wait(0.1)
                return False
            try:
                self._client = ModbusClient(self.link)
            except UserError as error:
                for meter in self.meters:
                    meter.trouble = str(error)
                return False
            self._backoff.reset()
        return True

    def _close(self) -> None:
        client, self._client = self._client, None
        if client is not None:
            client.close()
