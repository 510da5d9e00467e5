"""A subscriber that may publish messages, and the connection that it lives on."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import time
from collections.abc import AsyncIterator, Iterable, Sequence
from typing import Protocol

import aiomqtt

from acqd.errors import UserError, without_number
from acqd.retry import Backoff
from acqd.telemetry.message import Message
from acqd.telemetry.mqtt import BrokerAddress, is_refusal, refusal

_log = logging.getLogger(__name__)
_TIMEOUT_S = 5.0
_TICK_S = 1.0


class Bridge(Protocol):
    """What an integration does with messages."""

    def subscriptions(self) -> Sequence[str]:
        """Topics whose messages `take` wants."""

    def will(self) -> Message | None:
        """What the broker publishes when the connection breaks, and the bridge itself before it ends.

        Asked for once per connection, before `begin`.
        """

    def begin(self) -> Iterable[Message]:
        """A new connection: messages to send first."""

    def take(self, topic: str, payload: bytes) -> Iterable[Message]:
        """A message has arrived; the messages that it leads to."""

    def tick(self) -> Iterable[Message]:
        """Called every second; the messages that are due."""


class Relay:
    """Keeps a bridge connected until it is stopped."""

    def __init__(self, address: BrokerAddress, bridge: Bridge, name: str, qos: int = 1) -> None:
        """`name` is the client's identifier, one per bridge and broker; `qos` of what the bridge sends."""
        self._address, self._bridge, self._name, self._qos = address, bridge, name, qos
        self._failure = ""
        self._accepted = False
        self.connected = asyncio.Event()
        self.sent = 0
        """Messages."""

    async def run(self, stop: asyncio.Event, for_s: float | None = None) -> None:
        """Relay until `stop` is set; with `for_s`, until so many seconds after the last retained message.

        Raises UserError when the broker refuses the user at first contact or, with `for_s`, when none answers.
        """
        backoff = Backoff()
        while not stop.is_set():
            begun = time.monotonic()
            try:
                await self._session(stop, for_s)
                return
            except aiomqtt.MqttError as error:
                self._say(str(error))
                if for_s is not None:
                    said = without_number(error)
                    text = f"broker {self._address} does not answer: {said}; start it, or check host and port"
                    raise UserError(text) from None
            if self.connected.is_set():
                backoff.ended(time.monotonic() - begun)
            self.connected.clear()
            with contextlib.suppress(TimeoutError):
                await asyncio.wait_for(stop.wait(), backoff.pause_s())

    def _say(self, reason: str) -> None:
        if is_refusal(reason) and not self._accepted:
            raise refusal(self._address, reason)
        if reason != self._failure:
            _log.warning("broker %s: %s; trying again", self._address, reason)
        self._failure = reason

    async def _session(self, stop: asyncio.Event, for_s: float | None) -> None:
        address, last = self._address, self._bridge.will()
        will = aiomqtt.Will(last.topic, last.payload, 1, last.retain) if last else None
        client = aiomqtt.Client(
            address.host, address.port, username=address.username, password=address.password, identifier=self._name,
            tls_context=address.tls_context(), timeout=_TIMEOUT_S, will=will, max_queued_incoming_messages=20_000,
        )  # fmt: skip
        async with client:
            _log.info("connected to broker %s", address)
            for topic in self._bridge.subscriptions():
                await client.subscribe(topic, qos=1)
            await self._send(client, self._bridge.begin())
            self._failure, self._accepted = "", True
            self.connected.set()
            await self._serve(client, stop, for_s)
            if last is not None:
                await self._send(client, [last])

    async def _serve(self, client: aiomqtt.Client, stop: asyncio.Event, for_s: float | None) -> None:
        quiet = time.monotonic()
        async for message in _messages(client, stop):
            if message is not None:
                await self._send(client, self._bridge.take(str(message.topic), bytes(message.payload)))
                quiet = time.monotonic() if message.retain else quiet  # a busy computer takes its time for them
                continue
            await self._send(client, self._bridge.tick())
            if for_s is not None and time.monotonic() - quiet > for_s:
                return

    async def _send(self, client: aiomqtt.Client, messages: Iterable[Message]) -> None:
        for message in messages:
            await client.publish(message.topic, message.payload, qos=self._qos, retain=message.retain)
            self.sent += 1


async def _messages(client: aiomqtt.Client, stop: asyncio.Event) -> AsyncIterator[aiomqtt.Message | None]:
    """Messages as they come, None about every second; ends with `stop`. Raises aiomqtt.MqttError."""
    arriving = aiter(client.messages)
    stopping = asyncio.create_task(stop.wait())
    coming = asyncio.ensure_future(anext(arriving))
    ticked = time.monotonic()
    try:
        while not stop.is_set():
            await asyncio.wait({coming, stopping}, timeout=_TICK_S, return_when=asyncio.FIRST_COMPLETED)
            if coming.done():
                yield coming.result()
                coming = asyncio.ensure_future(anext(arriving))
            if time.monotonic() - ticked >= _TICK_S:
                ticked = time.monotonic()
                yield None
    finally:
        for task in (coming, stopping):
            task.cancel()
            with contextlib.suppress(asyncio.CancelledError, aiomqtt.MqttError):
                await task
