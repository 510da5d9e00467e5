"""The sink: MQTT -> SQL, acknowledged to the broker only after the commit.

A durable MQTT 5 session: the broker keeps what a sink that is away has not confirmed. Several sinks
share the work through a shared subscription when they are given a group. Not by default: mosquitto
2.0.11 (Debian 12) forgets a shared subscription when it restarts, until its client is back, and
drops what is published in between; a plain one it keeps. MQTT 3.1.1 where the broker knows no 5.
"""

from __future__ import annotations

import logging
import random
import select
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import paho.mqtt.client as paho
import sqlalchemy as sa
from paho.mqtt.enums import CallbackAPIVersion, MQTTProtocolVersion
from paho.mqtt.packettypes import PacketTypes
from paho.mqtt.properties import Properties

from acqd.storage.writer import Received, Writer
from acqd.telemetry import topics
from acqd.telemetry.mqtt import NO_DELAY, BrokerAddress, is_refusal, pending, refusal

_log = logging.getLogger(__name__)
_BACKOFF_S = (0.2, 15.0)
_CONNECT_S = 5.0
_KEPT_S = 7 * 24 * 3600  # how long the broker keeps our session while we are away
_UNSUPPORTED = "unsupported protocol"
_DATABASE_AWAY = "paused for the database"
_STABLE_S = 5.0  # a connection that ends sooner may have been taken over by a client of the same name
_NO_ANSWER = "no answer to CONNECT"


@dataclass(frozen=True, slots=True)
class SinkSettings:
    """How the sink batches and shares."""

    client_id: str = "acqd-sink"
    group: str = ""
    """Shared-subscription group: its sinks share the rows. Empty: every row comes here."""
    batch: int = 2_000
    """Messages per transaction at most; also what the broker may have under way to us."""
    interval: float = 0.25
    """Longest time [s] a row waits for its commit."""
    mqtt5: bool = True
    """MQTT 5 if the broker can; False: MQTT 3.1.1 from the start."""


@dataclass(slots=True)
class SinkCounters:
    """What the sink has done so far."""

    rows: int = 0
    quarantined: int = 0
    batches: int = 0
    reconnects: int = -1
    last_commit: float | None = None
    """Monotonic time of the last commit."""
    database_trouble: str = ""
    """Why the database takes no rows; empty while it does."""
    database_returns: int = 0
    """Times the database came back."""


class Sink:
    """Runs in the calling thread only: receive, write, acknowledge, in turn."""

    def __init__(self, address: BrokerAddress, engine: sa.Engine, settings: SinkSettings | None = None) -> None:
        self._address = address
        self._writer = Writer(engine)
        self._settings = settings or SinkSettings()
        self._arrived: list[paho.MQTTMessage] = []
        self._tls = address.tls_context()
        self._protocol = MQTTProtocolVersion.MQTTv5 if self._settings.mqtt5 else MQTTProtocolVersion.MQTTv311
        self._failure: str | None = None
        self._connected = self._accepted = self._subscribed = False
        self._unanswered = 0
        self.counters = SinkCounters()

    @property
    def connected(self) -> bool:
        """Whether the broker has taken our subscription (a backlog of rows may come before the acknowledgement)."""
        return self._connected and self._subscribed

    @property
    def _shares(self) -> bool:
        return bool(self._settings.group) and self._protocol == MQTTProtocolVersion.MQTTv5

    def run(self, stop: Callable[[], bool], progress: Callable[[], None] = lambda: None) -> None:
        """Until `stop()`. Raises UserError when the broker refuses us at first contact."""
        delay = _BACKOFF_S[0]
        while not stop():
            client = self._connect()
            if client is not None:
                begun = time.monotonic()
                try:
                    self._consume(client, stop, progress)
                finally:
                    client.disconnect()
                    self._connected = False
                if stop():
                    return
                if time.monotonic() - begun > _STABLE_S:
                    delay = _BACKOFF_S[0]
                elif self._failure != _DATABASE_AWAY:
                    self._failure = f"{self._failure} (does another sink use the client_id {self._settings.client_id}?)"
            elif self._step_down():
                continue
            elif self._failure and is_refusal(self._failure) and self.counters.reconnects < 0:
                raise refusal(self._address, self._failure)
            if delay == _BACKOFF_S[0]:
                _log.warning("broker %s: %s; retrying", self._address, self._failure)
            self._sleep(delay * random.uniform(0.5, 1.0), stop, progress)
            delay = min(2 * delay, _BACKOFF_S[1])

    def _step_down(self) -> bool:
        """After a failed connect: whether to try MQTT 3.1.1 at once. The next failure returns to 5."""
        was_five = self._protocol == MQTTProtocolVersion.MQTTv5
        self._unanswered = self._unanswered + 1 if self._failure == _NO_ANSWER and was_five else 0
        if was_five and (self._failure == _UNSUPPORTED or self._unanswered >= 2):
            _log.info("broker %s speaks no MQTT 5: rows cannot be shared between sinks", self._address)
            self._protocol = MQTTProtocolVersion.MQTTv311
            return True
        if self._settings.mqtt5:
            self._protocol = MQTTProtocolVersion.MQTTv5
        return False

    def _sleep(self, seconds: float, stop: Callable[[], bool], progress: Callable[[], None]) -> None:
        deadline = time.monotonic() + seconds
        while time.monotonic() < deadline and not stop():
            progress()
            time.sleep(0.05)

    def _connect(self) -> paho.Client | None:
        """A fresh client, subscribed; None when that failed (`_failure` says why)."""
        self._failure, self._connected, self._accepted, self._subscribed = None, False, False, False
        self._arrived = []
        five = self._protocol == MQTTProtocolVersion.MQTTv5
        client = paho.Client(
            CallbackAPIVersion.VERSION2,
            client_id=self._settings.client_id,
            protocol=self._protocol,
            clean_session=None if five else False,
            manual_ack=True,
            reconnect_on_failure=False,
        )
        if self._address.username is not None:
            client.username_pw_set(self._address.username, self._address.password)
        if self._tls is not None:
            client.tls_set_context(self._tls)
        client.on_connect, client.on_disconnect = self._on_connect, self._on_disconnect
        client.on_subscribe = self._on_subscribe
        client.on_message = lambda _client, _data, message: self._arrived.append(message)
        client.on_socket_open = _no_delay
        client.connect_timeout = _CONNECT_S
        arguments: dict[str, Any] = {"clean_start": False, "properties": self._session()} if five else {}
        try:
            client.connect(self._address.host, self._address.port, keepalive=10, **arguments)
        except (OSError, ValueError) as error:
            self._failure = str(error)
            return None
        deadline = time.monotonic() + _CONNECT_S
        self._connected = True  # as far as TCP goes
        while not self._accepted and self._failure is None and time.monotonic() < deadline:
            self._receive(client, deadline - time.monotonic())
            if client.socket() is None:
                break
        self._connected = self._accepted and self._failure is None
        if self._connected:
            return client
        self._failure = self._failure or _NO_ANSWER
        return None

    def _session(self) -> Properties:
        properties = Properties(PacketTypes.CONNECT)  # type: ignore[no-untyped-call]
        properties.SessionExpiryInterval = _KEPT_S
        properties.ReceiveMaximum = min(self._settings.batch, 65_535)
        return properties

    def _on_connect(self, client: paho.Client, _data: Any, _flags: Any, reason: Any, _properties: Any) -> None:
        if reason.is_failure:
            self._failure = _UNSUPPORTED if "protocol" in str(reason).lower() else str(reason)
            return
        self._accepted = True
        self.counters.reconnects += 1
        if self._shares:
            client.unsubscribe(topics.ALL_POWER)  # a session from a time without sharing would get every row
            client.subscribe(f"$share/{self._settings.group}/{topics.ALL_POWER}", qos=1)
        else:
            client.subscribe(topics.ALL_POWER, qos=1)

    def _on_subscribe(self, _client: Any, _data: Any, _mid: Any, reasons: list[Any], _properties: Any) -> None:
        if reasons[0].is_failure:
            self._failure = (
                f"subscription refused: {reasons[0]}; check the broker's access rules for {topics.ALL_POWER}"
            )
            self._connected = False
            return
        self._subscribed = True
        version = "5" if self._protocol == MQTTProtocolVersion.MQTTv5 else "3.1.1"
        sharing = f", sharing in group {self._settings.group}" if self._shares else ""
        _log.info("connected to broker %s (MQTT %s%s)", self._address, version, sharing)

    def _on_disconnect(self, _client: Any, _data: Any, _flags: Any, reason: Any, _properties: Any) -> None:
        if self._failure is None:
            # Before CONNACK: some 3.1.1 brokers just hang up on a version-5 CONNECT.
            self._failure = str(reason) if self._accepted else _NO_ANSWER
        self._connected = False

    def _consume(self, client: paho.Client, stop: Callable[[], bool], progress: Callable[[], None]) -> None:
        """Batches from this connection until it breaks or we are told to stop."""
        while not stop() and self._connected:
            batch = self._batch(client)
            progress()
            if batch and not self._commit(client, batch, stop, progress):
                return

    def _batch(self, client: paho.Client) -> list[paho.MQTTMessage]:
        """What arrives within the interval, at most a batch."""
        deadline = time.monotonic() + self._settings.interval
        while len(self._arrived) < self._settings.batch and self._connected:
            left = deadline - time.monotonic()
            if left <= 0:
                break
            self._receive(client, left)
        batch, self._arrived = self._arrived, []
        return batch

    def _receive(self, client: paho.Client, timeout: float) -> None:
        """Wait for packets and take those that are there."""
        sock = client.socket()
        if sock is None:
            self._connected = False
            return
        wait = 0.0 if pending(sock) else timeout
        readable, writable, _ = select.select([sock], [sock] if client.want_write() else [], [], wait)
        if writable:
            client.loop_write()
        while (readable or pending(client.socket())) and len(self._arrived) < self._settings.batch:
            before = len(self._arrived)
            client.loop_read()
            if len(self._arrived) == before:
                break
        client.loop_misc()

    def _commit(
        self,
        client: paho.Client,
        batch: list[paho.MQTTMessage],
        stop: Callable[[], bool],
        progress: Callable[[], None],
    ) -> bool:
        """Write and acknowledge. While the database is away, nothing is acknowledged or lost."""
        try:
            written = self._writer.write([Received(message.topic, bytes(message.payload)) for message in batch])
        except sa.exc.DBAPIError as error:
            _log.error("database: %s; %d messages stay with the broker", str(error.orig).strip(), len(batch))
            self._failure = _DATABASE_AWAY
            self.counters.database_trouble = str(error.orig).strip() or type(error.orig).__name__
            self._sleep(1.0, stop, progress)
            return False  # a new connection makes the broker send them again
        for message in batch:
            client.ack(message.mid, message.qos)
        counters = self.counters
        counters.database_returns += bool(counters.database_trouble)
        counters.database_trouble = ""
        if written.quarantined:
            _log.warning("%d malformed messages put into quarantine", written.quarantined)
        counters.rows += written.rows
        counters.quarantined += written.quarantined
        counters.batches += 1
        counters.last_commit = time.monotonic()
        return True


def _no_delay(_client: paho.Client, _data: Any, sock: Any) -> None:
    for option in NO_DELAY:
        sock.setsockopt(*option)
