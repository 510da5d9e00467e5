"""One connection of the sink to the broker: rows in, acknowledgements and receipts out, without threads.

Packets are read and written in large pieces. The object cannot be used again after it has failed.
"""

from __future__ import annotations

import contextlib
import select
import socket
import ssl
import time
from collections.abc import Sequence

from acqd.errors import UserError
from acqd.telemetry import wire
from acqd.telemetry.certificates import Validity, of_peer
from acqd.telemetry.mqtt import BrokerAddress, dial
from acqd.telemetry.wire import Hello, Packets, Publish

_PIECE = 1 << 18
_CONNECT_S = 5.0
_ANSWER_S = 2.5
NO_ANSWER = "no answer to CONNECT"
_SILENT_S = 5.0  # a broker that does not answer a ping for so long is dead


class SubscriberError(Exception):
    """The connection could not be made, or has ended; the text says why."""


class Subscriber:
    """`connect`, then `receive` again and again."""

    def __init__(self, address: BrokerAddress, hello: Hello) -> None:
        self._address, self._hello = address, hello
        self._packets = Packets(hello.version, hello.largest_packet)
        self._socket: socket.socket | ssl.SSLSocket | None = None
        self._out = bytearray()
        self._number = 0
        self._accepted = False
        self._sent_at = self._heard_at = time.monotonic()
        self._pinged_at: float | None = None
        self._arrived: list[Publish] = []
        self.subscribed = False
        """Whether the broker has confirmed the subscription (kept rows may come before that)."""
        self.refused = ""
        """Why it has refused the first topic of the subscription."""
        self.refused_topics: list[str] = []
        """All topics that it has refused."""
        self._topics: Sequence[str] = ()
        self.certificate: Validity | None = None
        """When the broker's certificate is valid; None without TLS."""

    @property
    def version(self) -> int:
        """Of the protocol."""
        return self._hello.version

    def connect(self) -> None:
        """Reach the broker and be accepted. Raises SubscriberError."""
        try:
            self._socket = dial(self._address, _CONNECT_S)
        except (OSError, ValueError, UserError) as error:
            raise SubscriberError(getattr(error, "strerror", None) or str(error)) from None
        self.certificate = of_peer(self._socket)
        self._out += wire.connect(self._hello)
        deadline = time.monotonic() + _ANSWER_S
        while not self._accepted:
            left = deadline - time.monotonic()
            self._exchange(max(0.0, left), ())
            if left < 0 and not self._accepted:
                raise SubscriberError(NO_ANSWER)

    def subscribe(self, *topics: str, leave: Sequence[str] = ()) -> None:
        """Subscribe once, with QoS 1, after leaving other topics; the first topic is the one that matters."""
        self._topics = topics
        if leave:
            self._out += wire.unsubscribe(self.version, self._next(), leave)
        self._out += wire.subscribe(self.version, self._next(), topics)

    def publish(self, topic: str, payload: bytes, *, retain: bool = False) -> None:
        """Publish with QoS 0."""
        self._out += wire.publish(self.version, topic, payload, retain=retain)

    def acknowledge(self, numbers: list[int]) -> None:
        """The rows with these packet numbers are stored."""
        self._out += wire.puback(numbers)

    def receive(self, timeout: float, also: Sequence[int] = (), *, read: bool = True) -> list[Publish]:
        """Messages that have arrived, after `timeout` seconds at the latest, or when one of `also` is readable.

        Without `read` none are taken: the connection is only kept alive. Raises SubscriberError.
        """
        if not read:
            self._pinged_at = None  # the answer stays unread
        self._ping_if_due()
        self._exchange(timeout, also, read=read)
        self._check_answer()
        arrived, self._arrived = self._arrived, []
        return arrived

    def close(self, *, farewell: tuple[str, bytes] | None = None) -> None:
        """Say good-bye, where possible with a last retained message, and close."""
        if self._socket is None:
            return
        if farewell is not None:
            self.publish(*farewell, retain=True)
        self._out += wire.GOODBYE
        with contextlib.suppress(OSError, SubscriberError):
            self._socket.settimeout(0.5)
            self._socket.sendall(self._out)
        with contextlib.suppress(OSError):
            self._socket.close()
        self._socket = None

    def _next(self) -> int:
        self._number = self._number % 65_535 + 1
        return self._number

    def _ping_if_due(self) -> None:
        now, answered = time.monotonic(), self._pinged_at is None or self._heard_at >= self._pinged_at
        if answered and now - min(self._sent_at, self._heard_at) > self._hello.keep_alive_s / 2:
            self._out += wire.PINGREQ
            self._pinged_at = now

    def _check_answer(self) -> None:
        """After all that has come was read: where this process stood still, the answer has waited meanwhile."""
        pinged_at = self._pinged_at
        if pinged_at is not None and self._heard_at < pinged_at and time.monotonic() - pinged_at > _SILENT_S:
            raise SubscriberError("no answer to a ping")

    def _exchange(self, timeout: float, also: Sequence[int], *, read: bool = True) -> None:
        """Send and receive what is possible."""
        sock = self._socket
        if sock is None:
            raise SubscriberError("not connected")
        waiting = isinstance(sock, ssl.SSLSocket) and sock.pending() > 0
        try:
            self._send(sock)
            number = sock.fileno()
            readable, writable, _ = select.select(
                [number, *also] if read else also, [number] if self._out else [], [], 0.0 if waiting else timeout
            )
            if writable:
                self._send(sock)
            if read and (waiting or number in readable):
                self._receive(sock)
        except (OSError, ValueError) as error:
            raise SubscriberError(getattr(error, "strerror", None) or str(error)) from None

    def _send(self, sock: socket.socket) -> None:
        while self._out:
            try:
                sent = sock.send(self._out)
            except (BlockingIOError, ssl.SSLWantReadError, ssl.SSLWantWriteError):
                return
            del self._out[:sent]
            self._sent_at = time.monotonic()

    def _receive(self, sock: socket.socket) -> None:
        try:
            data = sock.recv(_PIECE)
        except (BlockingIOError, ssl.SSLWantReadError, ssl.SSLWantWriteError):
            return
        if not data:
            raise SubscriberError("the broker has closed the connection" if self._accepted else NO_ANSWER)
        self._heard_at = time.monotonic()
        try:
            for kind, packet in self._packets.feed(data):
                if isinstance(packet, Publish):
                    self._arrived.append(packet)
                else:
                    self._take(kind, packet)
        except wire.ProtocolError as error:
            raise SubscriberError(str(error)) from None

    def _take(self, kind: int, body: bytes) -> None:
        if kind == wire.CONNACK:
            if refused := wire.connack(self.version, body):
                raise SubscriberError(refused)
            self._accepted = True
        elif kind == wire.SUBACK:
            codes = body[-len(self._topics) :]
            self.subscribed = codes[0] < 0x80
            self.refused = "" if self.subscribed else f"subscription refused with code {codes[0]}"
            self.refused_topics = [topic for topic, code in zip(self._topics, codes, strict=False) if code >= 0x80]
        elif kind == wire.DISCONNECT:
            raise SubscriberError(wire.reason(self.version, body))
