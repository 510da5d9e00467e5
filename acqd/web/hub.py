"""Rows from the broker to all viewers: collected for a moment, encoded once."""

from __future__ import annotations

import asyncio
import time
from collections.abc import AsyncIterator

import aiomqtt
import orjson

from acqd.telemetry import topics
from acqd.telemetry.mqtt import BrokerAddress
from acqd.telemetry.row import parse_row
from acqd.telemetry.row_message import payloads_of
from acqd.web.posture import Posture

FLUSH_S = 0.08
_BEHIND = 50
"""Events that wait for a viewer at most: four seconds; then the oldest are lost."""
_RETRY_S = 1.0
_BEAT_S = 5.0
_POSTURE_S = 0.2
_KEPT = ("broker", "status", "alarm", "posture", "wiring")
"""Events whose newest one a new viewer gets at once."""
_MOST_KEPT = 4_000
"""Of a thousand devices; strangers may publish under any name."""
_TOPICS = (
    topics.ALL_POWER, topics.ALL_WINDOWS, topics.ALL_STATUS, topics.ALL_PREDICTIONS, topics.ALL_ALARMS,
    topics.ALL_JOINTS,
)  # fmt: skip
_SHOWN = ("device", "channel", "boot", "seq", "time", "filetime", "Vrms", "Irms", "P", "S", "PF", "f", "W", "flags")


class Hub:
    """One subscription for any number of viewers."""

    def __init__(self, address: BrokerAddress, posture: Posture | None = None) -> None:
        """`posture`: the arm to draw; None: none is drawn."""
        self._address = address
        self._posture, self._postures = posture, dict[str, float]()
        self._viewers: set[asyncio.Queue[bytes]] = set()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._ended = False
        self._rows: list[dict[str, object]] = []
        self._state: dict[str, bytes] = {}
        self.connected = False
        self.trouble = "not connected yet"
        self.lost = 0
        """Events that viewers did not take in time."""

    async def run(self) -> None:
        """Subscribe until cancelled, and again whenever the connection is lost."""
        self._loop = asyncio.get_running_loop()
        async with asyncio.TaskGroup() as tasks:
            tasks.create_task(self._flush())
            tasks.create_task(self._beat())
            tasks.create_task(self._subscribe())

    async def _subscribe(self) -> None:
        while True:
            try:
                await self._receive()
            except aiomqtt.MqttError as error:
                self.trouble = str(error)
            self.connected = False
            self._tell("broker", {"connected": False, "trouble": self.trouble})
            await asyncio.sleep(_RETRY_S)

    async def _receive(self) -> None:
        address = self._address
        client = aiomqtt.Client(
            address.host, address.port, username=address.username, password=address.password,
            tls_context=address.tls_context(), timeout=5.0,
        )  # fmt: skip
        async with client:
            for topic in _TOPICS:
                await client.subscribe(topic, qos=0)
            self.connected, self.trouble = True, ""
            self._tell("broker", {"connected": True, "trouble": ""})
            async for message in client.messages:
                self.take(str(message.topic), bytes(message.payload))

    def take(self, topic: str, payload: bytes) -> None:
        """Take a message; messages of other programs are left out."""
        kind, device = topic.rpartition("/")[2], topic.split("/")[1]
        if kind in ("power", "window"):
            try:
                rows = [parse_row(part) for part in payloads_of(topic, payload)]
            except ValueError:
                return
            self._rows += [{name: getattr(row, name) for name in _SHOWN} for row in rows]
        elif kind == "status" and device != "sink":
            self._tell("status", {"device": device, "online": payload != topics.OFFLINE})
            self._wiring(device, payload)
        elif kind == "live":
            self._prediction(device, payload)
        elif kind == "alarm":
            self._alarm(device, payload)
        elif kind == "joints":
            self._joints(device, payload)

    def _wiring(self, daemon: str, payload: bytes) -> None:
        """Phasors and findings of the daemon's device, or of each of its boxes."""
        try:
            status = orjson.loads(payload)
            boxes = status.get("boxes") or {str(status.get("device", daemon)): status}
            found = {str(name): box["wiring"] for name, box in boxes.items() if box.get("wiring", {}).get("phasors")}
        except (orjson.JSONDecodeError, AttributeError):
            return
        for device, wiring in found.items():
            self._tell("wiring", {"device": device, "wiring": wiring})

    def _prediction(self, device: str, payload: bytes) -> None:
        try:
            message = orjson.loads(payload)
            power = {"device": device, "time": float(message["time"]), "P": float(message["P_predicted"])}
            power |= _by_cause(message)
        except (orjson.JSONDecodeError, KeyError, TypeError, ValueError):
            return
        self._tell("prediction", power)

    def _alarm(self, device: str, payload: bytes) -> None:
        """An empty message clears the alarm."""
        try:
            message = orjson.loads(payload) if payload else {}
            alarm = {name: message.get(name) for name in ("chart", "onset_s", "raised_s", "log")} if message else None
        except (orjson.JSONDecodeError, AttributeError):
            return
        self._tell("alarm", {"device": device, "alarm": alarm})

    def _joints(self, device: str, payload: bytes) -> None:
        """Five drawings a second are enough."""
        now = time.monotonic()
        if self._posture is None or now - self._postures.get(device, 0.0) < _POSTURE_S:
            return
        joints = self._posture.joints(payload)
        if joints is not None:
            if len(self._postures) > _MOST_KEPT:
                self._postures.clear()
            self._postures[device] = now
            self._tell("posture", {"device": device} | joints)

    def _tell(self, event: str, data: object) -> None:
        text = _event(event, data)
        if event in _KEPT:
            device = data.get("device", "") if isinstance(data, dict) else ""
            self._state[f"{event} {device}"] = text
            while len(self._state) > _MOST_KEPT:
                del self._state[next(iter(self._state))]
        for queue in self._viewers:
            while queue.full():
                queue.get_nowait()
                self.lost += 1
            queue.put_nowait(text)

    async def _flush(self) -> None:
        while True:
            await asyncio.sleep(FLUSH_S)
            if self._rows:
                rows, self._rows = self._rows, []
                if self._viewers:
                    self._tell("rows", rows)

    async def _beat(self) -> None:
        """The time of this computer now and then: a viewer's clock may be wrong, and one that has gone is noticed."""
        while True:
            self._tell("beat", {"time": time.time()})
            await asyncio.sleep(_BEAT_S)

    async def events(self) -> AsyncIterator[bytes]:
        """What one viewer gets, from now on."""
        queue: asyncio.Queue[bytes] = asyncio.Queue(_BEHIND)
        kept = list(self._state.values())  # there may be more than the queue holds
        self._viewers.add(queue)
        try:
            yield b"retry: 1000\n\n" + _event("beat", {"time": time.time()})
            for text in kept:
                yield text
            while not self._ended:
                yield await queue.get()
        finally:
            self._viewers.discard(queue)

    def end(self) -> None:
        """End the streams of all viewers, from any thread."""
        self._ended = True
        if self._loop is not None:
            self._loop.call_soon_threadsafe(self._tell, "end", {})

    @property
    def viewers(self) -> int:
        """How many look on."""
        return len(self._viewers)


def _by_cause(message: dict[str, object]) -> dict[str, object]:
    """Causes and joints of a message of acqd/DEVICE/prediction/live that has them. Raises ValueError, TypeError."""
    causes, joints = message.get("causes"), message.get("joints")
    if not isinstance(causes, dict) or not isinstance(joints, list):
        return {}
    powers = {str(name): float(power) for name, power in causes.items()}
    leading = [(str(name), float(power)) for name, power in joints]
    return {"causes": powers, "joints": leading} if all(name in powers for name, _ in leading) else {}


def _event(name: str, data: object) -> bytes:
    return b"event: %s\ndata: %s\n\n" % (name.encode(), orjson.dumps(data))
