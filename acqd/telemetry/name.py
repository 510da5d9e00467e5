"""One name, one daemon: who publishes under the name of a device.

A daemon that comes first listens whether another one is there (retained status, then its voice). The newcomer stands
by: its rows wait in the spool, and it asks again and again, so that both sides can name the other. It begins when the
other one says that it leaves, or has said nothing for long. Two that began at once see each other's status; the one
that a person has told to take the name stays, else the one that was there first.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import orjson

from acqd.telemetry.ask import Ask, Claimant, encode, parse_ask
from acqd.telemetry.topics import OFFLINE

_LISTEN_S = 0.25
"""The broker sends what it has retained right after the subscription."""
_SILENT_S = 25.0
"""A daemon publishes its status every 10 s."""
_RETAINED_S = 12.0
"""The same for a retained status: it may be of a daemon that is gone."""
_ASK_S = 5.0


class Name:
    """Of one run of a daemon; for one thread."""

    def __init__(self, me: Claimant, now: Callable[[], float] = time.monotonic) -> None:
        self.me, self._now = me, now
        self._held = False
        self._listen_until: float | None = None
        self._heard = self._ask_at = -1e9
        self._earlier = False
        """Whether the broker has kept a status of this installation: of its earlier run, or of a copy of its disk."""
        self.rival: Claimant | None = None
        """Another daemon of the name that was heard lately."""

    @property
    def held(self) -> bool:
        """Whether rows may go out."""
        return self._held

    @property
    def trouble(self) -> str:
        """What somebody has to know, else empty."""
        if self.rival is None:
            return ""
        if self._held:
            return f"another daemon has the same device name, and stands by: {self.rival}"
        return f"another daemon publishes under this device name: {self.rival}; rows wait in the spool"

    def begin(self) -> None:
        """A new connection."""
        self._listen_until = None
        self._heard = max(self._heard, self._now() - _SILENT_S + _RETAINED_S)

    def turn(self) -> bool:
        """Look at the time, once the subscription stands; whether the name has just become ours."""
        now = self._now()
        if self._held:
            if self.rival is not None and now - self._heard > _SILENT_S:
                self.rival = None
            return False
        if self._listen_until is None:
            self._listen_until = now + _LISTEN_S
        if self.rival is None:
            return now >= self._listen_until and self._take()
        return now - self._heard > _SILENT_S and self._take()

    def question(self) -> bytes | None:
        """What to ask now."""
        now = self._now()
        if self._earlier and not self._held:
            self._earlier = False
            return encode(Ask("name", who=self.me))
        if self.rival is None or (self._held and not self.me.taken) or now - self._ask_at < _ASK_S:
            return None
        self._ask_at = now
        return encode(Ask("name", who=self.me))

    def heard_status(self, payload: bytes, *, retained: bool) -> bool:
        """The status of the name; whether ours is to be published (again)."""
        if payload == OFFLINE:
            if self._held:
                return not retained  # the farewell of another one, or the last will of an earlier connection
            self.rival = None
            return self._take()
        other = _claimant(payload)
        if other is None or self._is_me(other, retained=retained):
            self._earlier |= other is not None and other.boot != self.me.boot
            return False
        self._note(other, retained=retained)
        if self._held:
            self._held = _precedence(self.me) < _precedence(other)
            return self._held
        return self.me.taken and self._take()

    def heard_ask(self, payload: bytes) -> bool:
        """A question; whether to answer with our status."""
        try:
            ask = parse_ask(payload)
        except ValueError:
            return False
        other = ask.who
        if ask.ask != "name" or other is None or self._is_me(other, retained=False):
            return False
        self._note(other, retained=False)
        if other.taken and not self.me.taken:
            self._held = False
        return self._held

    def _take(self) -> bool:
        self._held = True
        return True

    def _note(self, other: Claimant, *, retained: bool) -> None:
        now = self._now()
        self.rival = other
        self._heard = max(self._heard, now - _SILENT_S + _RETAINED_S if retained else now)

    def _is_me(self, other: Claimant, *, retained: bool) -> bool:
        """This run, or an earlier one of this installation, whose status the broker has kept."""
        return other.instance == self.me.instance and (retained or other.boot == self.me.boot)


def _precedence(claimant: Claimant) -> tuple[bool, str, str, str]:
    """The smaller one stays."""
    return not claimant.taken, claimant.since, claimant.instance, claimant.boot


def _claimant(payload: bytes) -> Claimant | None:
    """Who says a status; of an earlier acqd, as much as it says. None: no daemon that meters."""
    try:
        status: Any = orjson.loads(payload)
        name = status.get("name") or {}
        texts = {key: str(name.get(key, ""))[:128] for key in ("instance", "boot", "host", "since")}
        texts["boot"] = texts["boot"] or str(status.get("boot", ""))[:128]
        texts["since"] = texts["since"] or str(status.get("started", ""))[:128]
        return Claimant(**texts, taken=name.get("taken") is True) if texts["boot"] else None
    except (ValueError, AttributeError):
        return None
