"""Joint angles from a topic, power to another, row by row."""

from __future__ import annotations

import contextlib
import threading
import time
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import orjson
import paho.mqtt.client as paho
from paho.mqtt.enums import CallbackAPIVersion

from acqd.models.predictor import Predictor, Stream
from acqd.telemetry.mqtt import NO_DELAY, BrokerAddress

_EARLY, _LATE = 0.75, 1.75
"""Steps between rows: sooner ones are left out, after longer ones the prediction begins anew."""


@dataclass(slots=True)
class Live:
    """One model behind one topic. A message is {"time": Unix s, "q": [rad], "brake": 0/1, "tool": 0/1}."""

    model: Predictor
    joints_topic: str
    power_topic: str
    refused: int = 0
    predicted: int = 0
    _stream: Stream | None = None
    _last: float = 0.0
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def answer(self, payload: bytes) -> bytes | None:
        """The prediction that a row makes possible, `late_s` behind it; None for the first rows and for bad ones."""
        try:
            row = orjson.loads(payload)
            stamp, q = float(row["time"]), [float(each) for each in row["q"]]
            usual = self.model.usual_signals().tolist()
            signals = [float(row.get(n, u)) for n, u in zip(self.model.signals, usual, strict=True)]
        except (orjson.JSONDecodeError, KeyError, TypeError, ValueError):
            self.refused += 1
            return None
        if len(q) != self.model.axes or not np.isfinite([stamp, *q, *signals]).all():
            self.refused += 1
            return None
        step = self.model.step_s
        with self._lock:
            if 0 <= stamp - self._last < _EARLY * step:
                return None  # a faster sender: every row that is due is taken
            if self._stream is None or not 0 < stamp - self._last < _LATE * step:
                self._stream = Stream(self.model)  # a missing row would be a jump of the arm
            self._last = stamp
            with np.errstate(all="ignore"):
                power = self._stream.step(q, signals or None)  # type: ignore[arg-type]
            if power is not None and not np.isfinite(power):
                self._stream = None  # whatever such a row was, the model must not remember it
                self.refused += 1
                return None
        if power is None:
            return None
        self.predicted += 1
        late = self.model.radius * step
        return orjson.dumps({"time": stamp - late, "P_predicted": float(power), "late_s": late})

    def connect(self, address: BrokerAddress, client_id: str) -> paho.Client:
        """Subscribe in a thread of paho's; it reconnects by itself."""
        client = paho.Client(CallbackAPIVersion.VERSION2, client_id)
        if address.username is not None:
            client.username_pw_set(address.username, address.password)
        tls = address.tls_context()
        if tls is not None:
            client.tls_set_context(tls)
        client.on_connect = lambda c, *_: c.subscribe(self.joints_topic, qos=0)
        client.on_message = self._on_message
        client.on_socket_open = _no_delay
        client.reconnect_delay_set(1, 15)
        client.connect_async(address.host, address.port, keepalive=10)
        client.loop_start()
        return client

    def _on_message(self, client: paho.Client, _data: Any, message: Any) -> None:
        begun = time.monotonic()
        answer = self.answer(message.payload)
        if answer is not None:
            client.publish(self.power_topic, answer[:-1] + b',"step_ms":%.3f}' % (1000 * (time.monotonic() - begun)))


def _no_delay(_client: Any, _data: Any, sock: Any) -> None:
    with contextlib.suppress(OSError):
        for option in NO_DELAY:
            sock.setsockopt(*option)
