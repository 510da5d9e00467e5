"""One TCP connection of an AMS router, and its notifications."""

from __future__ import annotations

import asyncio
import socket
import struct
from collections import Counter
from dataclasses import dataclass, field
from itertools import count

from tests.doubles.ads.notifications import Notification, parse_attributes
from tests.doubles.ads.plc import Plc
from tests.doubles.ads.wire import PLC_PORT, AdsError, Code, Command, Frame, net_id_text, take_frame

_RESET_ON_CLOSE = struct.pack("ii", 1, 0)
"""SO_LINGER with a time of 0: close() sends RST."""


@dataclass
class Router:
    """What all connections share."""

    plc: Plc
    net_id: bytes
    routes: frozenset[bytes]
    """AMS net ids that may send requests; empty: all."""
    task_cycle: float
    """Cycle of the PLC task [s], the shortest notification cycle."""
    latency: float = 0.0
    silent: bool = False
    close_new: bool = False
    cut: int = 0
    """Octets of the next answer that are sent; 0: all. Its connection is stuck from then on."""
    connections: set[Connection] = field(default_factory=set)
    accepted: int = 0
    requests: Counter[str] = field(default_factory=Counter)
    clients: set[str] = field(default_factory=set)
    handles: count[int] = field(default_factory=lambda: count(1))


class Connection(asyncio.Protocol):
    """Takes requests from a client and sends replies in the order of the requests."""

    def __init__(self, router: Router) -> None:
        self.router = router
        self.notifications: dict[int, Notification] = {}
        self._buffer = bytearray()
        self._stuck = False
        self._transport: asyncio.Transport | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        self._transport = transport
        self.router.accepted += 1
        self.router.connections.add(self)
        if self.router.close_new:
            transport.close()

    def connection_lost(self, exc: Exception | None) -> None:
        self.router.connections.discard(self)
        for notification in self.notifications.values():
            notification.cancel()
        self.notifications.clear()

    def reset(self) -> None:
        """Close with RST."""
        if self._transport is not None:
            sock = self._transport.get_extra_info("socket")
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _RESET_ON_CLOSE)
            self._transport.abort()

    def data_received(self, data: bytes) -> None:
        self._buffer += data
        try:
            while frame := take_frame(self._buffer):
                if frame.is_request:
                    self._handle(frame)
        except ValueError:
            self.reset()

    def _handle(self, frame: Frame) -> None:
        """Serve one request; a router closes the connection of a net id that it has no route to."""
        if self.router.routes and frame.source.net_id not in self.router.routes:
            self.reset()
            return
        self.router.clients.add(net_id_text(frame.source.net_id))
        self.router.requests[_command_name(frame.command)] += 1
        if not self.router.silent:
            self._send(self._reply(frame))

    def _reply(self, frame: Frame) -> Frame:
        if frame.target.net_id != self.router.net_id:
            return frame.reply(b"", Code.TARGET_MACHINE_NOT_FOUND)
        if frame.target.port != PLC_PORT:
            return frame.reply(b"", Code.TARGET_PORT_NOT_FOUND)
        match frame.command:
            case Command.ADD_NOTIFICATION:
                return frame.reply(self._add_notification(frame))
            case Command.DELETE_NOTIFICATION:
                return frame.reply(self._delete_notification(frame.data))
        return frame.reply(self.router.plc.answer(frame.command, frame.data))

    def _add_notification(self, frame: Frame) -> bytes:
        plc, handle = self.router.plc, next(self.router.handles)
        try:
            wanted = parse_attributes(frame.data)
            plc.memory.read(wanted.group, wanted.offset, wanted.length, 0.0, observe=True)
        except AdsError as error:
            return struct.pack("<II", error.code, 0)
        self.notifications[handle] = Notification(
            handle, wanted, frame, plc.memory, self._send_notification, task_cycle=self.router.task_cycle
        )
        return struct.pack("<II", 0, handle)

    def _delete_notification(self, data: bytes) -> bytes:
        handle = int.from_bytes(data[:4], "little")
        notification = self.notifications.pop(handle, None)
        if notification is None:
            return struct.pack("<I", Code.NOTIFICATION_HANDLE_INVALID)
        notification.cancel()
        return struct.pack("<I", 0)

    def _send_notification(self, frame: Frame) -> None:
        if not self.router.silent:
            self._send(frame)

    def _send(self, frame: Frame) -> None:
        if self.router.latency > 0:
            asyncio.get_running_loop().call_later(self.router.latency, self._write, frame.encode())
        else:
            self._write(frame.encode())

    def _write(self, data: bytes) -> None:
        if self._stuck or self._transport is None or self._transport.is_closing():
            return
        if self.router.cut:
            data, self.router.cut, self._stuck = data[: self.router.cut], 0, True
        self._transport.write(data)


def _command_name(command: int) -> str:
    try:
        return Command(command).name.lower()
    except ValueError:
        return str(command)
