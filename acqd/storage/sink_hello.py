"""How the sink introduces itself to the broker."""

from __future__ import annotations

from acqd.storage.sink_settings import SinkSettings
from acqd.telemetry import topics
from acqd.telemetry.mqtt import BrokerAddress
from acqd.telemetry.wire import Hello

_KEPT_S = 7 * 24 * 3600
"""How long the broker keeps our session while we are away. In a group it ends with the connection: otherwise the broker
would go on sharing rows with a sink that is away, instead of giving them to the others."""
_KEEP_ALIVE_S = 10
LARGEST_PACKET = 64 << 10
"""Bytes of an MQTT packet at most; a row has a few hundred."""


def hello(address: BrokerAddress, settings: SinkSettings, version: int) -> Hello:
    """A session that the broker keeps, with limits, and a last will that tells the daemons."""
    return Hello(
        version=version,
        client_id=settings.client_id,
        keep_alive_s=_KEEP_ALIVE_S,
        username=address.username,
        password=address.password,
        will_topic=topics.sink_status(settings.client_id),
        will=topics.OFFLINE,
        session_s=0 if settings.group else _KEPT_S,
        receive_maximum=min(4 * settings.batch, 65_535),
        largest_packet=LARGEST_PACKET,
    )
