"""The embedded broker: amqtt, for trying things out and small cells. It runs in a separate process.

MQTT 3.1.1, loopback by default, no passwords: a plant runs mosquitto. See
`docs/adr/0004`.
"""

from __future__ import annotations

import asyncio
import logging
import re
import time
from typing import Any

from amqtt.adapters import StreamReaderAdapter, StreamWriterAdapter
from amqtt.broker import Broker
from amqtt.errors import AMQTTError

from acqd.telemetry.ports import check_port, free_port

__all__ = ["EmbeddedBroker", "check_port", "free_port"]

_log = logging.getLogger(__name__)
MOST_CONNECTIONS = 100
LARGEST_PACKET = 256 * 1024
"""Bytes. A row has 300, a prediction's message a few thousand."""
_PUBLISH, _SUBSCRIBE = 3, 8
_CONNECT_S = 5.0
"""A client that has not sent its CONNECT by then is disconnected (MQTT 3.1.1, section 3.1)."""


class EmbeddedBroker:
    """An anonymous broker on one TCP port."""

    def __init__(self, host: str, port: int) -> None:
        self.host, self.port = host, port
        # amqtt logs every packet it does not like; one process, one voice.
        for name in ("amqtt", "transitions"):
            logging.getLogger(name).setLevel(logging.CRITICAL)
        self._broker: Broker | None = None

    async def start(self) -> None:
        """Listen. Raises UserError when the port is taken or not allowed."""
        check_port(self.host, self.port)
        asyncio.get_running_loop().set_exception_handler(_quiet_strangers)
        self._broker = _BoundedBroker(
            {
                "listeners": {"default": {"type": "tcp", "bind": f"{self.host}:{self.port}"}},
                "plugins": {"amqtt.plugins.authentication.AnonymousAuthPlugin": {"allow_anonymous": True}},
            }
        )
        await self._broker.start()
        _log.info("embedded broker listens on %s:%d", self.host, self.port)

    async def stop(self) -> None:
        """Disconnect everybody, at most a second."""
        if self._broker is not None:
            try:
                await asyncio.wait_for(self._broker.shutdown(), 1.0)
            except TimeoutError:
                _log.debug("embedded broker was slow to stop")


_LEVEL = re.compile(rb"\x10[\x80-\xff]{0,3}[\x00-\x7f]\x00\x04MQTT(.)", re.DOTALL)
"""Begin of a CONNECT, with the version of the protocol (MQTT 3.1.1, section 3.1.2)."""
_LONGEST_BEGIN = 12
_NEWEST_LEVEL = 4
_UNSUPPORTED = bytes([0x20, 3, 0, 0x84, 0])
"""CONNACK of MQTT 5 that refuses the version; amqtt says nothing, and the client waits in vain."""


class _Kinds:
    """Kinds of the packets in a stream of bytes (MQTT 3.1.1, section 2.2): its head, then as many bytes as it says."""

    def __init__(self) -> None:
        self.used = False
        """Whether there was a packet that makes use of a broker: PUBLISH, SUBSCRIBE."""
        self._left = self._shift = 0
        self._in_head = False

    def feed(self, data: bytes) -> None:
        """The next bytes of the stream."""
        at = 0
        while at < len(data) and not self.used:
            if self._in_head:
                self._left |= (data[at] & 0x7F) << self._shift
                self._shift += 7
                self._in_head = data[at] >= 0x80
                at += 1
            elif self._left:
                skipped = min(self._left, len(data) - at)
                self._left -= skipped
                at += skipped
            else:
                self.used = data[at] >> 4 in (_PUBLISH, _SUBSCRIBE)
                self._in_head, self._shift = True, 0
                at += 1


class _BoundedReader(StreamReaderAdapter):  # type: ignore[misc]
    """Reads no packet that is larger than allowed, and no MQTT 5: to amqtt, the client has hung up then, for good."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        super().__init__(reader)
        self._writer, self._begin, self._refused = writer, b"", False
        self._kinds = _Kinds()
        self.since = time.monotonic()

    @property
    def idle(self) -> bool:
        """Whether the client has been there for a while and has neither subscribed nor published anything."""
        return not self._kinds.used and time.monotonic() - self.since > _CONNECT_S

    def close(self) -> None:
        """End the connection: somebody needs its place."""
        self._refused = True
        self._writer.close()

    async def read(self, n: int = -1) -> bytes:
        self._refused = self._refused or n > LARGEST_PACKET
        if self._refused:
            raise ConnectionResetError
        data = bytes(await super().read(n))
        self._kinds.feed(data)
        if len(self._begin) < _LONGEST_BEGIN:
            self._begin += data[:_LONGEST_BEGIN]
            if (found := _LEVEL.match(self._begin)) and found[1][0] > _NEWEST_LEVEL:
                self._refused = True
                self._writer.write(_UNSUPPORTED)
                raise ConnectionResetError
        return data


class _BoundedBroker(Broker):  # type: ignore[misc]
    """amqtt with limits, which closes every connection that it has given up."""

    def __init__(self, config: dict[str, Any]) -> None:
        super().__init__(config)
        self._readers: list[_BoundedReader] = []

    async def stream_connected(
        self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter, listener_name: str
    ) -> None:
        """One client from its first to its last byte."""
        if len(self._readers) >= MOST_CONNECTIONS:
            idle = next((one for one in self._readers if one.idle), None)
            if idle is None:
                writer.close()
                return
            self._readers.remove(idle)
            idle.close()
        bounded = _BoundedReader(reader, writer)
        self._readers.append(bounded)
        try:
            await self._client_connected(listener_name, bounded, StreamWriterAdapter(writer))
        except Exception as error:  # whatever a malformed packet makes amqtt raise: struct.error, UnicodeError ...
            _log.debug("embedded broker: %s", type(error).__name__)
        finally:
            if bounded in self._readers:
                self._readers.remove(bounded)
            writer.close()

    async def _publish_retained_messages_for_subscription(self, subscription: tuple[str, int], session: Any) -> None:
        """Only for a subscription of this client: amqtt 0.11 sends a new client what others have subscribed to."""
        if any(subscriber.client_id == session.client_id for subscriber, _ in self._subscriptions[subscription[0]]):
            await super()._publish_retained_messages_for_subscription(subscription, session)

    async def _initialize_client_session(self, *arguments: Any) -> Any:
        try:
            async with asyncio.timeout(_CONNECT_S):
                return await super()._initialize_client_session(*arguments)
        except TimeoutError:
            raise AMQTTError("no CONNECT in time") from None


def _quiet_strangers(loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
    """No traceback for a client that hangs up in the middle of its CONNECT."""
    error = context.get("exception")
    if isinstance(error, (OSError, asyncio.CancelledError)):
        _log.debug("embedded broker: %s", context["message"])
    else:
        loop.default_exception_handler(context)
