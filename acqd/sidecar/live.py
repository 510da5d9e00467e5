"""Predicts power row by row: joint angles from one MQTT topic, power to another."""

from __future__ import annotations

import contextlib
import logging
import threading
import time
from collections import deque
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import orjson
import paho.mqtt.client as paho
from paho.mqtt.enums import CallbackAPIVersion

from acqd.models.causes import has_parts, latest_parts
from acqd.models.predictor import Predictor, Stream
from acqd.telemetry.mqtt import NO_DELAY, BrokerAddress

_log = logging.getLogger(__name__)

_MIN_STEP, _MAX_STEP = 0.75, 1.75
"""Model steps between rows: earlier rows are left out, after a longer gap the prediction starts again."""

_CAUSES_S = 0.2
"""Between two messages with causes: five a second are enough for a picture."""
_REMEMBERED = 75
"""Rows that the split by cause is computed from: 3 s are longer than the lag of any supply."""


class _Row(NamedTuple):
    """One message."""

    time_s: float
    q: list[float]
    signals: list[float]


@dataclass(slots=True)
class Live:
    """One model between two topics. A message is {"time": Unix s, "q": [rad], "brake": 0/1, "tool": 0/1}."""

    model: Predictor
    joints_topic: str
    power_topic: str
    refused: int = 0
    predicted: int = 0
    _stream: Stream | None = None
    _last_s: float = 0.0
    _split_s: float = -np.inf
    _recent: deque[_Row] = field(default_factory=lambda: deque(maxlen=_REMEMBERED))
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def answer(self, payload: bytes) -> bytes | None:
        """The prediction that a row makes possible, for a time `late_s` earlier; None for the first and bad rows."""
        row = self._parsed(payload)
        if row is None:
            self.refused += 1
            return None
        with self._lock:
            power = self._step(row)
            split = {} if power is None else self._split(row.time_s)
        if power is None:
            return None
        self.predicted += 1
        late_s = self.model.radius * self.model.step_s
        return orjson.dumps({"time": row.time_s - late_s, "P_predicted": power, "late_s": late_s} | split)

    def _split(self, now_s: float) -> dict[str, Any]:
        """See `_causes`; at times only, and of no network. Predictions go on where the split fails."""
        if now_s - self._split_s < _CAUSES_S or not has_parts(self.model):
            return {}
        self._split_s = now_s
        try:
            return self._causes()
        except Exception:
            _log.exception("no causes in %s until the rows pause", self.power_topic)
            self._split_s = np.inf
            return {}

    def _causes(self) -> dict[str, Any]:
        """The power predicted last by cause [W], and the largest cause at every joint."""
        assert self._stream is not None
        q, signals = (np.array([row[k] for row in self._recent]) for k in (1, 2))
        joints: dict[str, Any] = {}
        for part in latest_parts(self.model, self._stream.state, q, signals):
            joints[part.cause.value] = joints.get(part.cause.value, 0.0) + part.joints[0]
        names, powers = list(joints), np.array(list(joints.values()))
        leading, whole = np.abs(powers[:, :-1]).argmax(axis=0), powers[:, :-1].sum(axis=0)
        return {
            "causes": {name: round(float(power.sum()), 2) for name, power in joints.items()},
            "joints": [[names[k], round(float(W), 2)] for k, W in zip(leading, whole, strict=True)],
        }

    def _parsed(self, payload: bytes) -> _Row | None:
        """The row of a message; None unless it has finite numbers for every joint."""
        usual = self.model.usual_signals().tolist()
        try:
            message = orjson.loads(payload)
            time_s, q = float(message["time"]), [float(angle) for angle in message["q"]]
            signals = [float(message.get(n, u)) for n, u in zip(self.model.signals, usual, strict=True)]
        except (orjson.JSONDecodeError, KeyError, TypeError, ValueError):
            return None
        usable = len(q) == self.model.axes and np.isfinite([time_s, *q, *signals]).all()
        return _Row(time_s, q, signals) if usable else None

    def _step(self, row: _Row) -> float | None:
        """W that the row makes predictable; None for a row that is early, among the first, or beyond all numbers."""
        step, elapsed = self.model.step_s, row.time_s - self._last_s
        if 0 <= elapsed < _MIN_STEP * step:
            return None  # the sender is faster than the model
        if self._stream is None or not 0 < elapsed < _MAX_STEP * step:
            self._recent.clear()
            self._split_s = -np.inf  # the sender's clock may have been set back
            self._stream = Stream(self.model)  # to the model, a missing row would be a jump of the arm
        self._last_s = row.time_s
        self._recent.append(row)
        with np.errstate(all="ignore"):
            power = self._stream.step(row.q, row.signals or None)  # type: ignore[arg-type]
        if power is not None and not np.isfinite(power):
            self._stream = None  # the model must not remember such a row
            self.refused += 1
            return None
        return None if power is None else float(power)

    def connect(self, address: BrokerAddress, client_id: str) -> paho.Client:
        """Subscribes in paho's network thread, which reconnects by itself."""
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
        client.suppress_exceptions = True  # one row must not end the thread of all later ones
        client.enable_logger(_log)
        client.connect_async(address.host, address.port, keepalive=10)
        client.loop_start()
        return client

    def _on_message(self, client: paho.Client, _data: Any, message: Any) -> None:
        started = time.monotonic()
        answer = self.answer(message.payload)
        if answer is not None:
            client.publish(self.power_topic, answer[:-1] + b',"step_ms":%.3f}' % (1000 * (time.monotonic() - started)))


def _no_delay(_client: Any, _data: Any, sock: Any) -> None:
    with contextlib.suppress(OSError):
        for option in NO_DELAY:
            sock.setsockopt(*option)
