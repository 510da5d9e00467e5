"""One connection of the daemon to a broker, on the running event loop: QoS 1, MQTT 3.1.1 or 5.

All messages of a window leave with one system call, and acknowledgements are read in large pieces (ADR 20).
"""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Sequence
from types import TracebackType
from typing import Any

from acqd.errors import UserError
from acqd.telemetry import wire
from acqd.telemetry.certificates import of_peer
from acqd.telemetry.loop_socket import LoopSocket, in_words, reach
from acqd.telemetry.message import Message, Outbox, Room
from acqd.telemetry.mqtt import BrokerAddress
from acqd.telemetry.patience import Patience
from acqd.telemetry.window import Window
from acqd.telemetry.wire import Hello, Packets, Publish

_CONNECT_S = 5.0
_ANSWER_S = 5.0
"""A broker that answers neither a subscription nor a ping for so long is dead."""
_KEEP_ALIVE_S = 10
_LOOK_S = 2.0
_LARGEST = 1 << 20
_PUBACK = b"\x40\x02"
_log = logging.getLogger(__name__)


class SessionError(Exception):
    """The connection could not be made, or has ended."""


class Session:
    """`async with Session(...)` connects; the object cannot be used again afterwards."""

    def __init__(
        self,
        address: BrokerAddress,
        client_id: str,
        will: Message,
        outbox: Outbox,
        *,
        version: int = wire.V311,
        patience: Patience | None = None,
    ) -> None:
        """`outbox` gets acknowledgements and the messages of subscriptions.

        A broker that acknowledges nothing within `patience`, though something is to be acknowledged, is dead.
        """
        self._address, self._outbox, self._version = address, outbox, version
        self._hello = Hello(
            version, client_id, _KEEP_ALIVE_S, address.username, address.password, will.topic, will.payload,
            session_s=0, receive_maximum=65_535, largest_packet=_LARGEST, clean=True, keep_will=will.retain,
        )  # fmt: skip
        self._loop = asyncio.get_running_loop()
        self._ended: asyncio.Future[str] = self._loop.create_future()
        self._connected: asyncio.Future[None] = self._loop.create_future()
        self._subscribed: asyncio.Future[None] = self._loop.create_future()
        self.window = Window()
        self._patience = Patience() if patience is None else patience
        self._doubted_after = -1  # so many acknowledgements
        self._packets = Packets(version, _LARGEST)
        self._socket: LoopSocket
        self.refused: dict[str, str] = {}
        """Topics whose messages the broker has refused, with its reason; MQTT 5 only."""
        self._number = 0
        self._pinged_at: float | None = None
        self._look: asyncio.TimerHandle | None = None

    async def __aenter__(self) -> Session:
        """Connect. Raises SessionError."""
        try:
            sock = await reach(self._address, _CONNECT_S)
        except (OSError, ValueError, UserError) as error:
            raise SessionError(in_words(error)) from None
        self.certificate = of_peer(sock)
        self._socket = LoopSocket(sock, self._take, self._end)
        try:
            self._socket.write(wire.connect(self._hello))
            await self._answer(self._connected, _CONNECT_S, "CONNECT")
        except BaseException:
            self._socket.close()
            raise
        self._look = self._loop.call_later(_LOOK_S, self._keep_alive)
        return self

    async def __aexit__(
        self, _kind: type[BaseException] | None, _error: BaseException | None, _trace: TracebackType | None
    ) -> None:
        if self._look is not None:
            self._look.cancel()
        self._socket.write(wire.GOODBYE)
        self._socket.close()

    async def subscribe(self, names: Sequence[str]) -> None:
        """Subscribe with QoS 1. Raises SessionError when the broker does not answer.

        A refusal by the broker's access rules is not an error: the rows then wait for receipts that cannot come.
        """
        if names:
            self._socket.write(wire.subscribe(self._version, self._next(), names))
            await self._answer(self._subscribed, _ANSWER_S, "SUBSCRIBE")

    def send(self, *messages: Message) -> None:
        """Publish with QoS 1; the outbox hears of the acknowledgements. Raises SessionError."""
        if self._ended.done():
            raise SessionError(self._ended.result())
        packets = []
        for message in messages:
            number = self._next()
            packets.append(wire.publish(self._version, message.topic, message.payload, number, retain=message.retain))
            self.window.add(number, message)
        self._socket.write(b"".join(packets))

    def gather(self) -> None:
        """From now on, acknowledgements are read when somebody asks: with `room`, `check`, or by many at once."""
        self._socket.gather()

    def room(self) -> Room:
        """How many messages may be sent now."""
        self._socket.hear()
        return self.window.room()

    def check(self) -> None:
        """Raises SessionError when the connection has ended or the broker is silent."""
        self._socket.hear()
        if self._ended.done():
            raise SessionError(self._ended.result())
        if self.window.silent_s() > self._patience.s:
            # Where this process itself stood still, acknowledgements may wait to be read: doubt first.
            if self._doubted_after == self.window.acknowledged:
                self._patience.missed()
                raise SessionError("no acknowledgement")
            self._doubted_after = self.window.acknowledged

    async def finish(self, last: Message, timeout: float) -> None:
        """Send a last message and wait until all are acknowledged, at most `timeout` seconds. Raises SessionError."""
        self.send(last)
        deadline = time.monotonic() + timeout
        while len(self.window) and not self._ended.done() and time.monotonic() < deadline:
            await asyncio.sleep(0.005)
            self._socket.hear()

    async def _answer(self, answer: asyncio.Future[None], timeout: float, to: str) -> None:
        either: set[asyncio.Future[Any]] = {answer, self._ended}
        await asyncio.wait(either, timeout=timeout, return_when=asyncio.FIRST_COMPLETED)
        if not answer.done():
            raise SessionError(self._ended.result() if self._ended.done() else f"no answer to {to}")

    def _next(self) -> int:
        """The number of the next packet: none that waits for its acknowledgement."""
        self._number = self._number % 65_535 + 1
        while self._number in self.window:
            self._number = self._number % 65_535 + 1
        return self._number

    def _keep_alive(self) -> None:
        """Ping where nothing else is sent or heard; a broker that does not answer is dead."""
        now, sock = time.monotonic(), self._socket
        sock.hear()
        self._look = self._loop.call_later(_LOOK_S, self._keep_alive)
        if self._pinged_at is not None and sock.heard_at < self._pinged_at:
            if now - self._pinged_at > _ANSWER_S:
                sock.end("no answer to a ping")
        elif now - min(sock.sent_at, sock.heard_at) > _KEEP_ALIVE_S / 2:
            self._pinged_at = now
            sock.write(wire.PINGREQ)

    def _take(self, data: bytes) -> None:
        """Packets; nearly all of them are acknowledgements."""
        at = 0
        if not self._packets.partial:
            while data[at : at + 2] == _PUBACK and at + 4 <= len(data):
                self._acknowledged(data[at + 2] << 8 | data[at + 3])
                at += 4
            if at == len(data):
                return
        try:
            for kind, packet in self._packets.feed(data[at:] if at else data):
                if isinstance(packet, Publish):
                    self._receive(packet)
                else:
                    self._control(kind, packet)
        except wire.ProtocolError as error:
            self._socket.end(str(error))

    def _control(self, kind: int, body: bytes) -> None:
        if kind == wire.PUBACK and len(body) >= 2:
            number = body[0] << 8 | body[1]
            if len(body) > 2 and body[2] >= 0x80:
                self._refuse(number, wire.reason(self._version, body[2:]))
            else:
                self._acknowledged(number)
        elif kind == wire.CONNACK:
            if refused := wire.connack(self._version, body):
                self._socket.end(refused)
            elif not self._connected.done():
                self._connected.set_result(None)
        elif kind == wire.SUBACK:
            if max(body[2:], default=0) >= 0x80:
                _log.error("broker %s refuses subscriptions to receipts; check its access rules", self._address)
            if not self._subscribed.done():
                self._subscribed.set_result(None)

    def _acknowledged(self, number: int) -> None:
        message = self.window.settle(number)
        if message is not None:
            self._patience.answered(self.window.took_s)
            self._outbox.acknowledged(message)

    def _refuse(self, number: int, reason: str) -> None:
        message = self.window.settle(number)
        if message is not None:
            self.refused[message.topic] = reason

    def _receive(self, message: Publish) -> None:
        if message.number:
            self._socket.write(wire.puback([message.number]))
        if message.oversized:
            _log.warning("%s: a message of %d bytes is left out", message.topic, message.oversized)
        else:
            self._outbox.received(message.topic, message.payload, retained=message.retained)

    def _end(self, reason: str) -> None:
        if not self._ended.done():
            self._ended.set_result(reason)
