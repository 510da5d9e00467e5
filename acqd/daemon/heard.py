"""Numbers that a topic says meanwhile: predictions of a sidecar, rows of a meter."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import orjson
import paho.mqtt.client as mqtt
from paho.mqtt.enums import CallbackAPIVersion
from paho.mqtt.reasoncodes import ReasonCode

from acqd.telemetry.mqtt import BrokerAddress

_MOST = 100_000


class Heard:
    """Fields of the messages of one device's topics while this object lives."""

    def __init__(
        self, address: BrokerAddress | None, device: str, topics: Sequence[str], fields: Sequence[str]
    ) -> None:
        """`topics` below acqd/<device>/. Without an address nothing is heard."""
        self._values: dict[tuple[str, str], list[float]] = {}
        self._client: mqtt.Client | None = None
        self._fields = fields
        self.trouble = "" if address is None else f"the broker at {address.host}:{address.port} does not answer"
        """Why nothing could be heard; else empty."""
        if address is None:
            return
        client = mqtt.Client(CallbackAPIVersion.VERSION2)
        if address.username:
            client.username_pw_set(address.username, address.password)
        if (context := address.tls_context()) is not None:
            client.tls_set_context(context)
        self._topics = {f"acqd/{device}/{topic}": topic for topic in topics}
        client.on_connect = self._subscribe
        client.on_message = lambda _client, _data, message: self.take(self._topics[message.topic], message.payload)
        client.connect_async(address.host, address.port)
        client.loop_start()
        self._client = client

    def _subscribe(self, client: mqtt.Client, _data: object, _flags: object, reason: ReasonCode, _more: object) -> None:
        self.trouble = f"the broker refuses acqd doctor ({reason})" if reason.is_failure else ""
        for topic in self._topics if not reason.is_failure else ():
            client.subscribe(topic)

    def take(self, topic: str, payload: bytes | bytearray) -> None:
        """One message; what is no row, and values that are null, are passed over."""
        try:
            row = orjson.loads(payload)
            found = {name: float(row[name]) for name in self._fields if row[name] is not None}
        except (orjson.JSONDecodeError, KeyError, TypeError, ValueError):
            return
        for name, value in found.items():
            values = self._values.setdefault((topic, name), [])
            if np.isfinite(value) and len(values) < _MOST:
                values.append(value)

    def stop(self) -> None:
        """End the connection."""
        if self._client is not None:
            self._client.disconnect()
            self._client.loop_stop()

    def mean(self, topic: str, field: str) -> float | None:
        """Of the values so far; None without any."""
        values = self._values.get((topic, field), [])
        return float(np.mean(values)) if values else None
