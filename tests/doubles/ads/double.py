"""A TwinCAT PC with the ring `GVL_Acqd`, in a thread of the test's process."""

from __future__ import annotations

import asyncio
import threading
import time
from dataclasses import dataclass, field
from types import TracebackType
from typing import Literal, Self

from tests.doubles.ads.clock import LockstepClock, RealClock, SlotClock
from tests.doubles.ads.commands import Commands, JsonObject
from tests.doubles.ads.connection import Connection, Router
from tests.doubles.ads.memory import PlcMemory
from tests.doubles.ads.plc import Plc
from tests.doubles.ads.ring import Ring
from tests.doubles.ads.wire import PORT, net_id_bytes
from tests.doubles.waveform import WaveTable

_START_TIMEOUT_S = 10.0


@dataclass(frozen=True)
class Settings:
    """What a double serves. `drift_ppm` > 0: the PLC's clock is fast (only with the real clock)."""

    host: str = "127.0.0.2"
    clock: Literal["lockstep", "real"] = "lockstep"
    drift_ppm: float = 0.0
    frames: int = 20
    phases: int = 3
    slots: int = 512
    advance: int = 20
    """Slots per read of the head (only with the lockstep clock)."""
    sample_ns: int = 50_000
    routes: tuple[str, ...] = ()
    """AMS net ids of clients that are answered; empty: all."""
    boot: int = field(default_factory=lambda: time.time_ns() // 1_000_000 & 0xFFFFFFFF)

    @property
    def net_id(self) -> str:
        return f"{self.host}.1.1"


class AdsDouble:
    """AMS/TCP server on port 48898 of `settings.host`; a context manager.

    It answers for the net id `<host>.1.1` and the AMS port 851. Symbol names and structures are in
    `docs/twincat/README.md`. `wave` has the samples: the slot s holds `wave.codes((s - 1) * frames, frames)`.
    Notifications need the real clock: lockstep time stands still between two reads of the head.
    """

    def __init__(self, settings: Settings | None = None) -> None:
        self.settings = settings or Settings()
        self.wave = WaveTable(rate=1e9 / self.settings.sample_ns, phases=self.settings.phases)
        self.ring = _make_ring(self.settings, self.wave)
        self._router = Router(
            Plc(PlcMemory(self.ring)),
            net_id_bytes(self.settings.net_id),
            frozenset(net_id_bytes(route) for route in self.settings.routes),
            self.ring.clock.slot_ns * 1e-9,
        )
        self._commands = Commands(self._router, self)
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._serve, name=f"ads-double-{self.settings.host}", daemon=True)
        self._started = threading.Event()
        self._failure: OSError | None = None
        self._server: asyncio.Server | None = None
        self._reopening: asyncio.TimerHandle | None = None

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.stop()

    def start(self) -> None:
        """Listen; raises OSError if the address cannot be bound."""
        self._thread.start()
        if not self._started.wait(_START_TIMEOUT_S):
            raise TimeoutError("the ADS double did not start")
        if self._failure is not None:
            raise self._failure

    def stop(self) -> None:
        """Reset all connections and end the thread."""
        if self._thread.is_alive():
            self._loop.call_soon_threadsafe(self._loop.stop)
            self._thread.join(_START_TIMEOUT_S)

    def command(self, **command: object) -> JsonObject:
        """Carry out a fault command in the server's thread, for example `command(latency_s=0.1)`.

        Raises ValueError for an unknown command or a wrong value.
        """
        future = asyncio.run_coroutine_threadsafe(self._run_command(command), self._loop)
        return future.result(_START_TIMEOUT_S)

    def refuse(self, seconds: float) -> None:
        """Close the listening socket for `seconds`; 0 opens it again. Open connections stay. (Server's thread.)"""
        if self._server is not None:
            self._server.close()
            self._server = None
        if self._reopening is not None:
            self._reopening.cancel()
        self._reopening = self._loop.call_later(seconds, lambda: self._loop.create_task(self._listen()))

    async def _run_command(self, command: JsonObject) -> JsonObject:
        return self._commands.run(command)

    async def _listen(self) -> None:
        self._server = await self._loop.create_server(
            lambda: Connection(self._router), self.settings.host, PORT, reuse_address=True
        )

    def _serve(self) -> None:
        """Body of the thread."""
        asyncio.set_event_loop(self._loop)
        try:
            self._loop.run_until_complete(self._listen())
        except OSError as error:
            self._failure = error
            self._loop.close()
            return
        finally:
            self._started.set()
        self._loop.run_forever()
        self._loop.run_until_complete(self._close())
        self._loop.close()

    async def _close(self) -> None:
        if self._server is not None:
            self._server.close()
        for connection in list(self._router.connections):
            connection.reset()
        await asyncio.sleep(0)


def _make_ring(settings: Settings, wave: WaveTable) -> Ring:
    return Ring(_make_clock(settings), wave, frames=settings.frames, slots=settings.slots, boot=settings.boot)


def _make_clock(settings: Settings) -> SlotClock:
    slot_ns = settings.frames * settings.sample_ns
    if settings.clock == "real":
        return RealClock(slot_ns, settings.drift_ppm)
    return LockstepClock(slot_ns, settings.advance)
