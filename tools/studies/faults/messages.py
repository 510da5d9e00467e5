"""Messages of somebody else."""

from __future__ import annotations

import time
from collections.abc import Sequence

import paho.mqtt.client as paho
from paho.mqtt.enums import CallbackAPIVersion

from acqd.errors import OperationError


def publish(port: int, messages: Sequence[tuple[str, bytes]], *, retain: bool = False) -> None:
    """Publish with QoS 1 and wait for the acknowledgements, 10 s at most: a broker may refuse a message for ever.

    Raises OperationError.
    """
    deadline = time.monotonic() + 10
    client = paho.Client(CallbackAPIVersion.VERSION2)
    try:
        client.connect("127.0.0.1", port)
        client.loop_start()
        for info in [client.publish(topic, payload, qos=1, retain=retain) for topic, payload in messages]:
            info.wait_for_publish(max(0.0, deadline - time.monotonic()))
    except (OSError, RuntimeError, ValueError) as error:
        raise OperationError(f"a stranger's messages could not be published: {error}") from None
    finally:
        client.loop_stop()
        client.disconnect()
