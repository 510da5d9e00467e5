"""One connection to a broker, on the running event loop: paho's protocol, asyncio's sockets.

aiomqtt would do, but spends two tasks and a timer on every message, a hundred times a second.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import socket
import ssl
import threading
import time
from collections.abc import Sequence
from types import TracebackType
from typing import Any

import paho.mqtt.client as paho
from paho.mqtt.enums import CallbackAPIVersion

from acqd.telemetry.message import Message, Outbox
from acqd.telemetry.mqtt import NO_DELAY, BrokerAddress, pending
from acqd.telemetry.window import Window

_CONNECT_S = 5.0
_ACK_S = 5.0
"""A broker that acknowledges nothing for so long, though something is to be acknowledged, is dead."""
_KEEPALIVE_S = 10
_log = logging.getLogger(__name__)


class SessionError(Exception):
    """The connection could not be made, or has ended."""


class Session:
    """`async with Session(...)` connects; the object cannot be used again afterwards."""

    def __init__(
        self, address: BrokerAddress, tls: ssl.SSLContext | None, client_id: str, will: Message, outbox: Outbox
    ) -> None:
        """`outbox` gets acknowledgements and the messages of subscriptions."""
        self._address, self._outbox = address, outbox
        self._loop = asyncio.get_running_loop()
        self._ended: asyncio.Future[str] = self._loop.create_future()
        self._connected: asyncio.Future[None] = self._loop.create_future()
        self.window = Window()
        self._subscribed: asyncio.Future[None] = self._loop.create_future()
        self._housekeeping: asyncio.Task[None] | None = None
        client = paho.Client(CallbackAPIVersion.VERSION2, client_id, reconnect_on_failure=False)
        client.max_inflight_messages_set(0)  # the window is kept here
        client.will_set(will.topic, will.payload, qos=1, retain=will.retain)
        if address.username is not None:
            client.username_pw_set(address.username, address.password)
        client.on_connect, client.on_disconnect = self._on_connect, self._on_disconnect
        client.on_publish, client.on_message = self._on_publish, self._on_message
        client.on_subscribe = self._on_subscribe
        client.connect_timeout = _CONNECT_S
        if tls is not None:
            client.tls_set_context(tls)
        self._client = client

    async def __aenter__(self) -> Session:
        """Connect. Raises SessionError."""
        await self._reach()
        sock: Any = self._client.socket()
        if sock is None:  # the peer has reset the connection before CONNECT was written: paho has closed the socket
            raise SessionError(self._ended.result() if self._ended.done() else "connection reset")
        with contextlib.suppress(OSError):  # a TLS socket has it set on the one below
            for option in NO_DELAY:
                sock.setsockopt(*option)
        # From here on, and only on this thread, paho asks the loop instead of the socket.
        self._client.on_socket_register_write = self._on_socket_register_write
        self._client.on_socket_unregister_write = self._on_socket_unregister_write
        self._client.on_socket_close = self._on_socket_close
        self._loop.add_reader(sock, self._read)
        self._client.loop_write()
        try:
            either: set[asyncio.Future[Any]] = {self._connected, self._ended}
            await asyncio.wait(either, timeout=_CONNECT_S, return_when=asyncio.FIRST_COMPLETED)
            if not self._connected.done():
                raise SessionError(self._ended.result() if self._ended.done() else "no answer to CONNECT")
        except BaseException:
            self._drop()
            raise
        self._housekeeping = self._loop.create_task(self._keep_alive())
        return self

    async def __aexit__(
        self, _kind: type[BaseException] | None, _error: BaseException | None, _trace: TracebackType | None
    ) -> None:
        if self._housekeeping is not None:
            self._housekeeping.cancel()
        self._client.disconnect()
        self._client.loop_write()
        self._drop()

    async def _reach(self) -> None:
        """Name look-up, TCP and TLS, in a thread: they block, and the loop must keep metering.

        Not in the loop's thread pool: the daemon would have to wait for it when it stops.
        """
        reached: asyncio.Future[None] = self._loop.create_future()

        def tell(error: Exception | None) -> None:
            if reached.cancelled():
                return
            if error is None:
                reached.set_result(None)
            else:
                reached.set_exception(SessionError(getattr(error, "strerror", None) or str(error)))

        def connect() -> None:
            failure: Exception | None = None
            try:
                self._client.connect(self._address.host, self._address.port, _KEEPALIVE_S)
            except (OSError, ValueError) as error:
                failure = error
            with contextlib.suppress(RuntimeError):  # the loop has closed meanwhile
                self._loop.call_soon_threadsafe(tell, failure)

        threading.Thread(target=connect, name="mqtt-connect", daemon=True).start()
        await reached

    async def subscribe(self, names: Sequence[str]) -> None:
        """Subscribe with QoS 1. Raises SessionError when the broker does not answer.

        A refusal by the broker's access rules is not an error: the rows then wait for receipts that cannot come.
        """
        if not names:
            return
        self._client.subscribe([(name, 1) for name in names])
        either: set[asyncio.Future[Any]] = {self._subscribed, self._ended}
        await asyncio.wait(either, timeout=_ACK_S, return_when=asyncio.FIRST_COMPLETED)
        if not self._subscribed.done():
            raise SessionError(self._ended.result() if self._ended.done() else "no answer to SUBSCRIBE")

    def send(self, message: Message) -> None:
        """Publish with QoS 1; the outbox hears of the acknowledgement. Raises SessionError."""
        if self._ended.done():
            raise SessionError(self._ended.result())
        info = self._client.publish(message.topic, message.payload, qos=1, retain=message.retain)
        if info.rc != paho.MQTT_ERR_SUCCESS:
            raise SessionError(paho.error_string(info.rc))
        self.window.add(info.mid, message)

    def check(self) -> None:
        """Raises SessionError when the connection has ended or the broker is silent."""
        if self._ended.done():
            raise SessionError(self._ended.result())
        if self.window.silent_s() > _ACK_S:
            raise SessionError("no acknowledgement")

    async def finish(self, last: Message, timeout: float) -> None:
        """Send a last message and wait until all are acknowledged, at most `timeout` seconds. Raises SessionError."""
        self.send(last)
        deadline = time.monotonic() + timeout
        while len(self.window) and not self._ended.done() and time.monotonic() < deadline:
            await asyncio.sleep(0.005)

    async def _keep_alive(self) -> None:
        while True:
            await asyncio.sleep(1.0)
            self._client.loop_misc()

    def _read(self) -> None:
        self._client.loop_read()
        # TLS may hold packets that it has already read from the socket: the socket does not wake us for those.
        while pending(self._client.socket()):
            self._client.loop_read()

    def _drop(self) -> None:
        """Close the socket without a DISCONNECT."""
        sock: Any = self._client.socket()
        if sock is not None:
            self._forget(sock)
            sock.close()

    def _forget(self, sock: socket.socket) -> None:
        if sock.fileno() >= 0:
            self._loop.remove_reader(sock)
            self._loop.remove_writer(sock)

    def _on_connect(self, _client: Any, _data: Any, _flags: Any, reason: Any, _properties: Any) -> None:
        if reason.is_failure:
            self._end(str(reason))
        elif not self._connected.done():
            self._connected.set_result(None)

    def _on_disconnect(self, _client: Any, _data: Any, _flags: Any, reason: Any, _properties: Any) -> None:
        self._end(str(reason))

    def _end(self, reason: str) -> None:
        if not self._ended.done():
            self._ended.set_result(reason)

    def _on_socket_register_write(self, client: paho.Client, _data: Any, sock: Any) -> None:
        self._loop.add_writer(sock, client.loop_write)

    def _on_socket_unregister_write(self, _client: Any, _data: Any, sock: Any) -> None:
        self._loop.remove_writer(sock)

    def _on_socket_close(self, _client: Any, _data: Any, sock: Any) -> None:
        self._forget(sock)

    def _on_publish(self, _client: Any, _data: Any, mid: int, _reason: Any, _properties: Any) -> None:
        message = self.window.settle(mid)
        if message is not None:
            self._outbox.acknowledged(message)

    def _on_subscribe(self, _client: Any, _data: Any, _mid: Any, reasons: list[Any], _properties: Any) -> None:
        if any(reason.is_failure for reason in reasons):
            _log.error("broker %s refuses subscriptions to receipts; check its access rules", self._address)
        if not self._subscribed.done():
            self._subscribed.set_result(None)

    def _on_message(self, _client: Any, _data: Any, message: paho.MQTTMessage) -> None:
        self._outbox.received(message.topic, bytes(message.payload), retained=message.retain)
