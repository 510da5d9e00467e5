"""Messages of somebody else."""

from __future__ import annotations

from collections.abc import Sequence

import paho.mqtt.client as paho
from paho.mqtt.enums import CallbackAPIVersion

from acqd.errors import OperationError


def publish(port: int, messages: Sequence[tuple[str, bytes]]) -> None:
    """Publish with QoS 1 and wait for the acknowledgements. Raises OperationError."""
    client = paho.Client(CallbackAPIVersion.VERSION2)
    try:
        client.connect("127.0.0.1", port)
        client.loop_start()
        for info in [client.publish(topic, payload, qos=1) for topic, payload in messages]:
            info.wait_for_publish(10)
    except (OSError, RuntimeError, ValueError) as error:
        raise OperationError(f"a stranger's messages could not be published: {error}") from None
    finally:
        client.loop_stop()
        client.disconnect()
