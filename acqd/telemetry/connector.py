"""MQTT_CONNECTOR: delivers an outbox to the broker, for as long as it takes.

One supervisor, a new client object for every connection, jittered exponential back-off, a sliding window of messages
that the broker has not acknowledged. The daemon starts, meters and stops without a broker, also with one that refuses
its password.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import math
import time
from collections.abc import Callable, Sequence
from typing import Literal

from acqd.errors import UserError
from acqd.retry import Backoff
from acqd.telemetry.certificates import Validity
from acqd.telemetry.message import Message, Outbox, Room
from acqd.telemetry.mqtt import BrokerAddress, is_refusal, refusal
from acqd.telemetry.patience import Patience
from acqd.telemetry.session import Session, SessionError
from acqd.telemetry.topics import OFFLINE

_log = logging.getLogger(__name__)
_FAREWELL_S = 0.5
_SHORT, _SHORT_S = 3, 10.0
"""So many connections in a row that the broker ends within this time: another client takes our name."""
State = Literal["connecting", "connected", "stopped"]


class Connector:
    """Publishes what is in the outbox; `run` until cancelled."""

    def __init__(
        self,
        address: BrokerAddress,
        outbox: Outbox,
        *,
        client_id: str,
        status_topic: str,
        greeting: Callable[[], bytes | None],
        must_connect: bool = False,
    ) -> None:
        """`greeting` makes the retained status message of a fresh connection; None: the status is another daemon's.

        With `must_connect`, a broker that does not answer or refuses us at first contact is an error, not a wait.
        """
        self._must_connect = must_connect
        self._address = address
        self._outbox = outbox
        self._client_id = client_id
        self._status_topic = status_topic
        self._greeting = greeting
        address.tls_context()  # files that cannot be used are an error of the start
        self._failure = ""
        self.state: State = "connecting"
        self._session_now: Session | None = None
        self.delivered = 0
        """Messages that the broker has acknowledged."""
        self.reconnects = -1
        self.certificate: Validity | None = None
        """When the certificate is valid that the broker has shown last; None without TLS."""
        self._short, self._since = 0, -math.inf
        self._patience = Patience()

    @property
    def trouble(self) -> str:
        """Why there is no connection, or what is wrong with connections that are lost again and again, else empty."""
        lasts = self.state == "connected" and time.monotonic() - self._since > _SHORT_S
        if self._short < _SHORT or lasts:
            return self._failure if self.state == "connecting" else ""
        return (
            f"connections end within seconds: does another daemon use the device name of {self._client_id}, or does "
            "the broker refuse what is sent (its log, max_packet_size)?"
        )

    async def run(self) -> None:
        """Connect, deliver, reconnect. Raises UserError at first contact, with `must_connect` only."""
        backoff = Backoff()
        while True:
            begun = time.monotonic()
            try:
                await self._session()
            except SessionError as error:
                reason = str(error)
                if self._must_connect and self.reconnects < 0:
                    raise self._first_failure(reason) from None
                if self.state == "connected":
                    lasted_s = time.monotonic() - begun
                    backoff.ended(lasted_s)
                    self._count_short(lasted_s)
                self._say(reason)
                self.state = "connecting"
            await asyncio.sleep(backoff.pause_s())

    def _count_short(self, lasted_s: float) -> None:
        self._short = self._short + 1 if lasted_s < _SHORT_S else 0
        if self._short == _SHORT:
            _log.error("broker %s: %s", self._address, self.trouble)

    async def flush(self, timeout: float) -> None:
        """Wait until the outbox is empty, at most `timeout` seconds and only while connected."""
        deadline = asyncio.get_running_loop().time() + timeout
        while len(self._outbox) and self.state == "connected" and asyncio.get_running_loop().time() < deadline:
            await asyncio.sleep(0.01)
            if self._session_now is not None:
                self._session_now.room()  # listens

    def _first_failure(self, reason: str) -> UserError:
        if is_refusal(reason):
            return refusal(self._address, reason)
        return UserError(f"broker {self._address} does not answer: {reason}; start it, or check host and port")

    def _say(self, reason: str) -> None:
        """Log a change of state, not every attempt."""
        if self.state == "connected":
            _log.warning("broker %s lost: %s; %d messages wait", self._address, reason, len(self._outbox))
        elif reason != self._failure and is_refusal(reason):
            _log.error("%s; trying again", refusal(self._address, reason))
        elif reason != self._failure:
            _log.warning("broker %s not reachable: %s; retrying", self._address, reason)
        self._failure = reason

    async def _session(self) -> None:
        will = Message(self._status_topic, OFFLINE, retain=True)
        async with Session(self._address, self._client_id, will, self._outbox, patience=self._patience) as session:
            self.reconnects += 1
            self.state, self._failure, self._since = "connected", "", time.monotonic()
            self.certificate = session.certificate
            _log.info("connected to broker %s", self._address)
            try:
                self._outbox.begin()
                await session.subscribe(self._outbox.subscriptions())
                if (greeting := self._greeting()) is not None:
                    session.send(Message(self._status_topic, greeting, retain=True))
                session.gather()
                self._session_now = session
                self._outbox.ready(_Line(session))
                await self._deliver(session)
            except asyncio.CancelledError:
                self.state = "stopped"
                # The will is for accidents; a planned stop says so itself.
                if self._greeting() is not None:
                    with contextlib.suppress(SessionError):
                        await session.finish(will, _FAREWELL_S)
                raise
            finally:
                self._session_now = None
                self._outbox.end()

    async def _deliver(self, session: Session) -> None:
        """Keep the window full until the connection ends. Raises SessionError."""
        before = self.delivered
        while True:
            session.check()
            room = session.window.room()  # `check` has just listened
            messages = await self._outbox.take(room)
            if messages:
                session.send(*messages)
            self.delivered = before + session.window.acknowledged
            await self._outbox.wait()


class _Line:
    """The session as the outbox sees it."""

    def __init__(self, session: Session) -> None:
        self._session = session

    def room(self) -> Room:
        """Of the window."""
        return self._session.room()

    def send(self, messages: Sequence[Message]) -> None:
        """Publish; that a connection has ended is said where it is awaited."""
        with contextlib.suppress(SessionError):
            self._session.send(*messages)
