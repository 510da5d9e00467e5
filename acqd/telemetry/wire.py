"""MQTT packets, 3.1.1 and 5 (OASIS standards, sections 2 and 3): what sink and daemon send and receive.

paho spends more time on a packet than the database on a row (ADR 14). Only what these two need is here: QoS 0 and 1,
no topic aliases, which the broker may use only where a client allows them.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

V311, V5 = 4, 5
CONNACK, PUBLISH, PUBACK, SUBACK, PINGRESP, DISCONNECT = 2, 3, 4, 9, 13, 14
_SHORT = struct.Struct("!H")
_KEPT_OF_OVERSIZED = 1024
_MOST_TOPICS = 4096
UNSUPPORTED = "unsupported protocol version"
_REASONS = {
    (V311, 1): UNSUPPORTED,
    (V311, 2): "client identifier not valid",
    (V311, 3): "server unavailable",
    (V311, 4): "bad user name or password",
    (V311, 5): "not authorized",
    (V5, 0x84): UNSUPPORTED,
    (V5, 0x85): "client identifier not valid",
    (V5, 0x86): "bad user name or password",
    (V5, 0x87): "not authorized",
    (V5, 0x88): "server unavailable",
    (V5, 0x89): "server busy",
    (V5, 0x8A): "banned",
    (V5, 0x8B): "server shutting down",
    (V5, 0x8D): "keep alive timeout",
    (V5, 0x8E): "session taken over",
    (V5, 0x93): "receive maximum exceeded",
    (V5, 0x95): "packet too large",
    (V5, 0x97): "quota exceeded",
    (V5, 0x9A): "retained messages are not supported, and acqd needs them",
    (V5, 0x9B): "QoS 1 is not supported, and acqd needs it",
    (V5, 0x9F): "connection rate exceeded",
}


class ProtocolError(Exception):
    """The broker has sent what is no MQTT."""


class Publish(NamedTuple):
    """A message that has arrived; `number` is 0 with QoS 0."""

    topic: str
    payload: bytes
    number: int
    oversized: int = 0
    """Bytes of a message that is longer than the limit; its payload is cut."""
    retained: bool = False
    """The broker had kept it from before."""


@dataclass(frozen=True, slots=True)
class Hello:
    """What a CONNECT says."""

    version: int
    client_id: str
    keep_alive_s: int
    username: str | None
    password: str | None
    will_topic: str
    will: bytes
    session_s: int
    """How long the broker keeps the session while the client is away."""
    receive_maximum: int
    largest_packet: int
    clean: bool = False
    """The broker forgets what it knows of an earlier session."""
    keep_will: bool = True
    """The will is retained."""


def connect(hello: Hello) -> bytes:
    """CONNECT (3.1.1 knows no limits of time and size)."""
    flags = 0x04 | 1 << 3 | (0x20 if hello.keep_will else 0) | (0x02 if hello.clean else 0)  # a will with QoS 1
    flags |= (0x80 if hello.username is not None else 0) | (0x40 if hello.password is not None else 0)
    body = _text("MQTT") + bytes([hello.version, flags]) + _SHORT.pack(hello.keep_alive_s)
    if hello.version == V5:
        body += _block(
            b"\x11" + struct.pack("!I", hello.session_s)
            + b"\x21" + _SHORT.pack(hello.receive_maximum)
            + b"\x27" + struct.pack("!I", hello.largest_packet)
        )  # fmt: skip
    body += _text(hello.client_id) + (_block(b"") if hello.version == V5 else b"")
    body += _text(hello.will_topic) + _SHORT.pack(len(hello.will)) + hello.will
    for secret in (hello.username, hello.password):
        body += _text(secret) if secret is not None else b""
    return _packet(0x10, body)


def subscribe(version: int, number: int, topics: Sequence[str]) -> bytes:
    """SUBSCRIBE with QoS 1."""
    filters = b"".join(_text(topic) + b"\x01" for topic in topics)
    return _packet(0x82, _SHORT.pack(number) + (b"\0" if version == V5 else b"") + filters)


def unsubscribe(version: int, number: int, topics: Sequence[str]) -> bytes:
    """UNSUBSCRIBE."""
    return _packet(0xA2, _SHORT.pack(number) + (b"\0" if version == V5 else b"") + b"".join(map(_text, topics)))


def publish(version: int, topic: str, payload: bytes, number: int = 0, *, retain: bool = False) -> bytes:
    """PUBLISH, with QoS 1 where the packet has a number."""
    head = _text(topic) + (_SHORT.pack(number) if number else b"") + (b"\0" if version == V5 else b"")
    return _packet(0x30 | (0x02 if number else 0) | (0x01 if retain else 0), head + payload)


def puback(numbers: list[int]) -> bytes:
    """One PUBACK for each packet number."""
    return b"".join([b"\x40\x02" + _SHORT.pack(number) for number in numbers])


PINGREQ = b"\xc0\x00"
GOODBYE = b"\xe0\x00"
"""DISCONNECT; MQTT 5: the broker keeps the session as CONNECT has said."""


class Packets:
    """Cuts the stream of bytes into packets; no packet is held in memory beyond the largest one allowed."""

    def __init__(self, version: int, largest: int) -> None:
        self._version, self._largest = version, largest
        self._data = bytearray()
        self._skip = 0
        self._topics: dict[bytes, str] = {}

    @property
    def partial(self) -> bool:
        """Whether the next byte is in the middle of a packet."""
        return bool(self._data or self._skip)

    def feed(self, data: bytes) -> Iterator[tuple[int, bytes | Publish]]:
        """Type and body of every packet that is complete now, a PUBLISH decoded. Raises ProtocolError."""
        if self._skip:
            skipped = min(self._skip, len(data))
            self._skip -= skipped
            data = data[skipped:]
        self._data += data
        at, buffer = 0, bytes(self._data)
        try:
            while (head := _head(buffer, at)) is not None:
                start, length = head
                first, there = buffer[at], len(buffer) - start
                if length > self._largest and there >= min(length, _KEPT_OF_OVERSIZED):
                    yield self._oversized(first, buffer[start : start + _KEPT_OF_OVERSIZED], length)
                    self._skip = max(0, length - there)
                    at = min(len(buffer), start + length)
                    continue
                if length > there:
                    break
                at = start + length
                if first >> 4 == PUBLISH:
                    yield PUBLISH, self._publish(first, buffer, start, at)
                else:
                    yield first >> 4, buffer[start:at]
        finally:
            del self._data[:at]

    def _publish(self, first: int, data: bytes, at: int, end: int) -> Publish:
        """The message whose packet has its body in data[at:end]."""
        body, number = at, 0
        try:
            at += 2 + (data[at] << 8 | data[at + 1])
            name = data[body + 2 : at]
            if first & 0x06:
                number = data[at] << 8 | data[at + 1]
                at += 2
            if self._version == V5:
                length, at = (0, at + 1) if data[at] == 0 else _variable(data, at)
                at += length
        except IndexError:
            at = end + 1
        if at > end:
            raise ProtocolError("a PUBLISH is malformed")
        return Publish(self._topics.get(name) or self._topic(name), data[at:end], number, 0, bool(first & 0x01))

    def _topic(self, name: bytes) -> str:
        """The text of a topic, which comes again and again."""
        if len(self._topics) >= _MOST_TOPICS:
            self._topics.clear()
        self._topics[name] = topic = name.decode(errors="replace")
        return topic

    def _oversized(self, first: int, begin: bytes, length: int) -> tuple[int, Publish]:
        if first >> 4 != PUBLISH:
            raise ProtocolError(f"a packet of type {first >> 4} has {length} bytes")
        return PUBLISH, self._publish(first, begin, 0, len(begin))._replace(oversized=length)


def connack(version: int, body: bytes) -> str:
    """Why the broker refuses the connection; empty: it does not. Raises ProtocolError."""
    if len(body) < 2:
        raise ProtocolError("CONNACK is too short")
    code = body[1]
    return "" if code == 0 else _REASONS.get((version, code), f"refused with code {code}")


def reason(version: int, body: bytes) -> str:
    """Why the broker has sent DISCONNECT."""
    code = body[0] if body else 0
    return _REASONS.get((version, code), f"disconnected with code {code}")


def _head(data: bytes, at: int) -> tuple[int, int] | None:
    """Where the body of the packet begins, and its length; None while the head is not complete."""
    if len(data) - at > 2 and data[at + 2] < 0x80 <= data[at + 1]:  # two bytes of length, as nearly every message has
        return at + 3, data[at + 1] & 0x7F | data[at + 2] << 7
    length = shift = 0
    for k in range(at + 1, min(at + 5, len(data))):
        length |= (data[k] & 0x7F) << shift
        if data[k] < 0x80:
            return k + 1, length
        shift += 7
    if len(data) - at >= 5:
        raise ProtocolError("the length of a packet is malformed")
    return None


def _variable(data: bytes, at: int) -> tuple[int, int]:
    """A variable byte integer and the offset after it."""
    value = shift = 0
    for k in range(at, at + 4):
        value |= (data[k] & 0x7F) << shift
        if data[k] < 0x80:
            return value, k + 1
        shift += 7
    raise ProtocolError("a length is malformed")


def _length(length: int) -> bytes:
    encoded = bytearray()
    while True:
        length, low = divmod(length, 128)
        encoded.append(low | (0x80 if length else 0))
        if not length:
            return bytes(encoded)


def _block(data: bytes) -> bytes:
    return _length(len(data)) + data


def _packet(first: int, body: bytes) -> bytes:
    return bytes([first]) + _block(body)


def _text(text: str) -> bytes:
    data = text.encode()
    return _SHORT.pack(len(data)) + data
