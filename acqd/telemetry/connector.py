"""MQTT_CONNECTOR: delivers the outbox to the broker, for as long as it takes.

One supervisor, a new client object for every connection, jittered exponential back-off, messages
forgotten only on PUBACK. The daemon starts and meters without a broker.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import random
from collections.abc import Callable
from typing import Literal

from acqd.errors import UserError
from acqd.telemetry.mqtt import BrokerAddress, is_refusal, refusal
from acqd.telemetry.outbox import Message, Outbox
from acqd.telemetry.session import Session, SessionError
from acqd.telemetry.topics import OFFLINE

_log = logging.getLogger(__name__)
_BATCH = 64  # messages on their way at once
_BACKOFF_S = (0.2, 15.0)
_FAREWELL_S = 0.5
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
        greeting: Callable[[], bytes],
        must_connect: bool = False,
    ) -> None:
        """`greeting` makes the retained status message of a fresh connection.

        With `must_connect`, a broker that is not there at first contact is an error, not a wait.
        """
        self._must_connect = must_connect
        self._address = address
        self._outbox = outbox
        self._client_id = client_id
        self._status_topic = status_topic
        self._greeting = greeting
        self._tls = address.tls_context()
        self.state: State = "connecting"
        self.delivered = 0
        self.reconnects = -1

    async def run(self) -> None:
        """Connect, deliver, reconnect. Raises UserError when the broker refuses us at first contact."""
        delay = _BACKOFF_S[0]
        while True:
            try:
                await self._session()
            except SessionError as error:
                reason = str(error)
                if is_refusal(reason) and self.reconnects < 0:
                    raise refusal(self._address, reason) from None
                if self._must_connect and self.reconnects < 0:
                    raise UserError(
                        f"broker {self._address} does not answer: {reason}; start it, or check host and port"
                    ) from None
                if self.state == "connected":
                    delay = _BACKOFF_S[0]
                    _log.warning("broker %s lost: %s; %d messages wait", self._address, reason, len(self._outbox))
                elif delay == _BACKOFF_S[0]:
                    _log.warning("broker %s not reachable: %s; retrying", self._address, reason)
                self.state = "connecting"
            await asyncio.sleep(delay * random.uniform(0.5, 1.0))
            delay = min(2 * delay, _BACKOFF_S[1])

    async def flush(self, timeout: float) -> None:
        """Wait until the outbox is empty, at most `timeout` seconds and only while connected."""
        deadline = asyncio.get_running_loop().time() + timeout
        while len(self._outbox) and self.state == "connected" and asyncio.get_running_loop().time() < deadline:
            await asyncio.sleep(0.01)

    async def _session(self) -> None:
        will = Message(self._status_topic, OFFLINE, retain=True)
        async with Session(self._address, self._tls, self._client_id, will, _BATCH) as session:
            self.reconnects += 1
            self.state = "connected"
            _log.info("connected to broker %s", self._address)
            await session.publish([Message(self._status_topic, self._greeting(), retain=True)])
            try:
                while True:
                    messages = await self._outbox.peek(_BATCH)
                    await session.publish(messages)
                    self._outbox.confirm(messages)
                    self.delivered += len(messages)
            except asyncio.CancelledError:
                self.state = "stopped"
                # The will is for accidents; a planned stop says so itself.
                with contextlib.suppress(SessionError):
                    await session.publish([will], _FAREWELL_S)
                raise
