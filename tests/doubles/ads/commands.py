"""Fault commands: dictionaries as they come from a test or, as JSON, on the standard input."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, Protocol

from tests.doubles.ads.clock import LockstepClock
from tests.doubles.ads.connection import Router
from tests.doubles.ads.plc import Plc, State

JsonObject = dict[str, Any]


class Listener(Protocol):
    """The listening socket, which `refuse_s` closes for a time."""

    def refuse(self, seconds: float) -> None: ...


class Commands:
    """One method per command; each takes the command's value and the whole command."""

    def __init__(self, router: Router, listener: Listener) -> None:
        self._router = router
        self._listener = listener
        self._table: dict[str, Callable[[Any, JsonObject], None]] = {
            "latency_s": self._latency, "reset": self._reset, "refuse_s": self._refuse, "freeze": self._freeze,
            "state": self._state, "restart": self._restart, "skip_slots": self._skip, "tear": self._tear,
            "silent": self._silent, "status": self._status, "range": self._range, "remove_ring": self._remove_ring,
            "close_new": self._close_new, "advance": self._advance, "cut": self._cut,
        }  # fmt: skip

    def run(self, command: JsonObject) -> JsonObject:
        """Carry out every key of `command` that names a fault; {"stats": true} adds the figures to the answer.

        Raises ValueError for an unknown command or a wrong value.
        """
        unknown = command.keys() - self._table.keys() - {"stats", "channel", "quit"}
        if unknown:
            raise ValueError(f"unknown command: {', '.join(sorted(unknown))}")
        try:
            for name, value in command.items():
                if name in self._table:
                    self._table[name](value, command)
        except (TypeError, LookupError) as error:
            raise ValueError(f"{type(error).__name__}: {error}") from error
        return {"ok": True, **(self.stats() if command.get("stats") else {})}

    def stats(self) -> JsonObject:
        """Counters and the present state of the PLC."""
        router, plc, now = self._router, self._plc, time.monotonic()
        ring = plc.memory.ring
        return {
            "connections": len(router.connections), "accepted": router.accepted, "requests": dict(router.requests),
            "clients": sorted(router.clients), "handles": plc.memory.symbols.open_handles,
            "notifications": sum(len(connection.notifications) for connection in router.connections),
            "newest": ring.newest(now), "overruns": ring.overruns(now), "boot": ring.boot, "state": int(plc.state),
            "frozen": ring.clock.frozen, "tear": ring.tear,
        }  # fmt: skip

    @property
    def _plc(self) -> Plc:
        return self._router.plc

    def _latency(self, seconds: Any, _: JsonObject) -> None:
        self._router.latency = float(seconds)

    def _reset(self, wanted: Any, _: JsonObject) -> None:
        if wanted:
            for connection in list(self._router.connections):
                connection.reset()

    def _refuse(self, seconds: Any, _: JsonObject) -> None:
        self._listener.refuse(float(seconds))

    def _close_new(self, wanted: Any, _: JsonObject) -> None:
        self._router.close_new = bool(wanted)

    def _cut(self, octets: Any, _: JsonObject) -> None:
        """The next answer ends after so many octets, and that connection stays open without another one."""
        self._router.cut = int(octets)

    def _freeze(self, wanted: Any, _: JsonObject) -> None:
        ring = self._plc.memory.ring
        if wanted:
            ring.clock.freeze(time.monotonic())
        else:
            ring.unfreeze(time.monotonic())

    def _state(self, state: Any, _: JsonObject) -> None:
        self._plc.set_state(int(state), time.monotonic())

    def _restart(self, wanted: Any, _: JsonObject) -> None:
        if wanted:
            self._plc.set_state(State.RESET, time.monotonic())

    def _skip(self, slots: Any, _: JsonObject) -> None:
        self._plc.memory.ring.miss(int(slots), time.monotonic())

    def _tear(self, wanted: Any, _: JsonObject) -> None:
        self._plc.memory.ring.tear = bool(wanted)

    def _silent(self, wanted: Any, _: JsonObject) -> None:
        self._router.silent = bool(wanted)

    def _status(self, value: Any, command: JsonObject) -> None:
        self._plc.memory.ring.set_status(int(command["channel"]), int(value), time.monotonic())

    def _range(self, bits: Any, _: JsonObject) -> None:
        self._plc.memory.ring.set_range(int(bits), time.monotonic())

    def _remove_ring(self, wanted: Any, _: JsonObject) -> None:
        self._plc.memory.symbols.with_ring = not wanted

    def _advance(self, slots: Any, _: JsonObject) -> None:
        clock = self._plc.memory.ring.clock
        if not isinstance(clock, LockstepClock):
            raise ValueError("only the lockstep clock advances by reads")
        clock.advance = int(slots)
