"""What the broker has retained: states of daemons and sinks, the alarms that are active."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass, field
from typing import Any

import aiomqtt
import orjson

from acqd.errors import UserError, without_number
from acqd.integrations.alarms.states import wrong
from acqd.integrations.alarms.watch import ACTIVE
from acqd.integrations.daemons import Daemons
from acqd.telemetry import topics
from acqd.telemetry.mqtt import BrokerAddress, is_refusal, refusal

_QUIET_S = 1.0
"""A broker sends what it has retained right after the subscription: after so long without more, that was all."""
_MOST_S = 20.0
Status = dict[str, Any]


@dataclass(slots=True)
class Heard:
    """Retained messages of a broker."""

    daemons: dict[str, Status | None] = field(default_factory=dict)
    """Status by daemon; None: offline."""
    sinks: dict[str, Status | None] = field(default_factory=dict)
    alarms: list[dict[str, Any]] | None = None
    """As `acqd alarms` publishes them; None: it has never run on this broker."""
    faults: dict[str, dict[str, str]] = field(default_factory=dict)
    """What is wrong by the status of a daemon."""
    earlier: dict[tuple[str, str], Status] = field(default_factory=dict)
    """The last status of those that are offline, by "daemons" or "sinks" and name, where known."""
    _online: Daemons = field(default_factory=Daemons)
    _offline: Daemons = field(default_factory=Daemons)
    """A daemon that was renamed stays on the broker under its old name: asked only of devices that none online has."""

    def take(self, topic: str, payload: bytes) -> None:
        """A message."""
        match topic.split("/"):
            case ["acqd", "sink", name, "status"]:
                self.sinks[name] = _status(payload)
            case ["acqd", name, "status"]:
                self.daemons[name] = _status(payload)
                self.faults[name] = wrong(payload) or {}
                (self._offline if self.daemons[name] is None else self._online).take(name, payload)
            case _ if topic == ACTIVE:
                content = _json(payload)
                self.alarms = [each for each in content if isinstance(each, dict)] if isinstance(content, list) else []

    def remember(self, kind: str, name: str, status: Status) -> None:
        """Know what a daemon or a sink, which is offline now, once said."""
        self.earlier[kind, name] = status
        if kind == "daemons":
            self._offline.take(name, orjson.dumps(status))

    def daemon_of(self, device: str) -> str | None:
        """The daemon that meters a device, else one that did; None: no daemon has named it."""
        return self._online.of(device) or self._offline.of(device)


def _json(payload: bytes) -> Any:
    try:
        return orjson.loads(payload)
    except orjson.JSONDecodeError:
        return None


def _status(payload: bytes) -> Status | None:
    content = _json(payload)
    return content if isinstance(content, dict) else None


def listen(address: BrokerAddress) -> Heard:
    """Everything that is retained. Raises UserError for a broker that does not answer or refuses."""
    return asyncio.run(_listen(address))


async def _listen(address: BrokerAddress) -> Heard:
    heard = Heard()
    client = aiomqtt.Client(
        address.host, address.port, username=address.username, password=address.password,
        tls_context=address.tls_context(), timeout=5.0,
    )  # fmt: skip
    try:
        async with client:
            for topic in (topics.ALL_STATUS, topics.ALL_SINKS, ACTIVE):
                await client.subscribe(topic, qos=1)
            arriving = aiter(client.messages)
            async with asyncio.timeout(_MOST_S):
                while True:
                    message = await asyncio.wait_for(anext(arriving), _QUIET_S)
                    if message.retain:
                        heard.take(str(message.topic), bytes(message.payload))
    except TimeoutError:
        return heard
    except aiomqtt.MqttError as error:
        if is_refusal(str(error)):
            raise refusal(address, str(error)) from None
        raise UserError(
            f"broker {address} does not answer: {without_number(error)}; check host and port; is the broker up?"
        ) from None
