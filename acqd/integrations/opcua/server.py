"""The server: rows from the broker to variables, and bad values where rows stop."""

from __future__ import annotations

import asyncio
import hmac
import logging
import time
from collections import deque
from collections.abc import Iterable, Sequence
from pathlib import Path as FilePath
from typing import Any

from asyncua import Server, ua
from asyncua.crypto.permission_rules import User, UserRole
from asyncua.server import binary_server_asyncio

from acqd.errors import UserError
from acqd.integrations.daemons import Daemons
from acqd.integrations.opcua.section import OpcUaSection
from acqd.integrations.opcua.space import NAMESPACE, Path, Space, path_of
from acqd.integrations.quality import event_of, quality_of, subscriptions, wanted
from acqd.integrations.rows import TOPICS, rows_of
from acqd.telemetry import topics
from acqd.telemetry.event import PowerEvent
from acqd.telemetry.message import Message
from acqd.telemetry.quality_row import QualityRow
from acqd.telemetry.row import PowerRow

_log = logging.getLogger(__name__)
_WAITING = 20_000
"""Rows; the oldest are lost when a client keeps the server busy for longer."""
_LOOK_S = 0.02
_LARGEST_CHUNK = 1 << 20
"""Bytes; clients of these variables send a few thousand."""
_INTERVALS = 5


class OpcUaServer:
    """A bridge that answers with no messages: it writes the rows into the address space."""

    def __init__(self, section: OpcUaSection) -> None:
        self._section = section
        self._rows: deque[PowerRow | QualityRow | PowerEvent] = deque(maxlen=_WAITING)
        self._daemons = Daemons()
        self._seen: dict[Path, _Pace] = {}
        self._gone: set[str] = set()

    def subscriptions(self) -> Sequence[str]:
        """Rows, power quality and events, and whether their daemons are online."""
        return topics.ALL_STATUS, *TOPICS, *subscriptions(self._section.quality)

    def will(self) -> None:
        """No last will."""

    def begin(self) -> Iterable[Message]:
        """Nothing to send."""
        return ()

    def take(self, topic: str, payload: bytes) -> Iterable[Message]:
        """A row, an event or a status."""
        if topic.endswith("/status"):
            daemon = topic.split("/")[1]
            self._daemons.take(daemon, payload)
            (self._gone.add if payload == topics.OFFLINE else self._gone.discard)(daemon)
            return ()
        if topic.endswith("/quality"):
            row = quality_of(topic, payload)
            self._rows.extend([row] if row is not None and row.aggregation in wanted(self._section.quality) else [])
        elif topics.is_event(topic):
            event = event_of(topic, payload)
            self._rows.extend([event] if event is not None else [])
        else:
            self._rows.extend(rows_of(topic, payload))
        return ()

    def tick(self) -> Iterable[Message]:
        """Nothing is due."""
        return ()

    async def serve(self, stop: asyncio.Event) -> None:
        """Serve until `stop` is set. Raises UserError when the port or the certificate cannot be used."""
        server = await self._server()
        try:
            await server.start()
        except OSError as error:
            raise UserError(f"[opcua] {self.endpoint}: {error.strerror or error}; choose another port") from None
        _log.info("OPC UA server at %s", self.endpoint)
        try:
            space = Space(server, await server.register_namespace(NAMESPACE))
            while not stop.is_set():
                await self._write(space)
                await asyncio.sleep(_LOOK_S)
        finally:
            await server.stop()

    @property
    def endpoint(self) -> str:
        """What clients connect to."""
        return f"opc.tcp://{self._section.host}:{self._section.port}/acqd"

    async def _server(self) -> Server:
        section = self._section
        binary_server_asyncio.OPCUAProtocol = _BoundedProtocol
        server = Server(user_manager=_Readers(section.username, section.password))
        await server.init()
        server.set_endpoint(self.endpoint)
        server.set_server_name("acqd")
        if section.certificate is None or section.key is None:
            server.set_security_policy([ua.SecurityPolicyType.NoSecurity])
            return server
        try:
            await server.load_certificate(section.certificate, _form(section.certificate))
            await server.load_private_key(section.key, None, _form(section.key))
        except OSError as error:
            raise UserError(f"[opcua] {error.filename}: {error.strerror}; check certificate and key") from None
        except ValueError:
            raise UserError("[opcua] certificate or key cannot be read: expected PEM or DER, no password") from None
        server.set_security_policy([ua.SecurityPolicyType.Basic256Sha256_SignAndEncrypt])
        return server

    async def _write(self, space: Space) -> None:
        now = time.monotonic()
        while self._rows:
            message = self._rows.popleft()
            await space.write(message)
            if not isinstance(message, PowerEvent):  # an event stays what it was
                interval_s = message.duration if isinstance(message, QualityRow) else None
                self._seen.setdefault(path_of(message), _Pace(now)).next(now, message.boot, interval_s)
        for path, pace in self._seen.items():
            daemon = self._daemons.of(path[0], pace.boot)
            if pace.running and (now - pace.last > pace.limit(self._section.stale_s) or daemon in self._gone):
                pace.running = False
                await space.spoil(path)


class _BoundedProtocol(binary_server_asyncio.OPCUAProtocol):  # type: ignore[misc]
    """asyncua's, which would collect as many bytes as a chunk says that it has (OPC 10000-6, section 7.1.2.2)."""

    def data_received(self, data: bytes) -> None:
        """Called by asyncio."""
        head = (self._buffer[:8] + data[:8])[:8]
        if len(head) == 8 and int.from_bytes(head[4:], "little") > _LARGEST_CHUNK and self.transport is not None:
            _log.debug("OPC UA: %s announces a chunk of %d bytes", self.peer_name, int.from_bytes(head[4:], "little"))
            self.transport.close()
            return
        super().data_received(data)


def _form(path: FilePath) -> str:
    """Of a certificate or key; asyncua would go by the name. Raises OSError."""
    return "pem" if path.read_bytes().startswith(b"-----BEGIN") else "der"


class _Pace:
    """When the rows of a channel come."""

    def __init__(self, now: float) -> None:
        self.last, self.interval, self.running, self.boot = now, 0.0, True, ""

    def next(self, now: float, boot: str, interval_s: float | None) -> None:
        """A row has come; `interval_s`: time between rows, where it is known."""
        if interval_s is not None:
            self.interval = interval_s
        elif self.running and now > self.last:
            self.interval = now - self.last
        self.last, self.running, self.boot = now, True, boot

    def limit(self, shortest_s: float) -> float:
        """Silence that means an end of the rows [s]."""
        return max(shortest_s, _INTERVALS * self.interval)


class _Readers:
    """Every client reads and none writes; with a user name, only those who know the password."""

    def __init__(self, username: str | None, password: str | None) -> None:
        self._wanted = (username, password)

    def get_user(
        self, _server: Any, username: str | None = None, password: str | None = None, certificate: Any = None
    ) -> User | None:
        """The user's role, None to refuse."""
        del certificate
        name, secret = self._wanted
        if name is not None and secret is not None:
            same = hmac.compare_digest(str(username).encode(), name.encode())
            if not (hmac.compare_digest(str(password).encode(), secret.encode()) and same):
                return None
        return User(role=UserRole.User)
