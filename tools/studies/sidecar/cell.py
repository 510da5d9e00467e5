"""The sidecar as a process, and a listener on its topics."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import orjson
import paho.mqtt.client as paho
from paho.mqtt.enums import CallbackAPIVersion

from acqd.errors import OperationError

DEVICE = "cell-01"


@dataclass(slots=True)
class Listener:
    """Everything that is published below a topic, with the time of arrival."""

    port: int
    topic: str
    messages: list[tuple[float, dict[str, Any]]] = field(default_factory=list)
    client: paho.Client = field(default_factory=lambda: paho.Client(CallbackAPIVersion.VERSION2))

    def __enter__(self) -> Listener:
        self.client.on_connect = lambda c, *_: c.subscribe(self.topic, qos=1)
        self.client.on_message = lambda _c, _d, m: self.messages.append((time.monotonic(), orjson.loads(m.payload)))
        self.client.connect("127.0.0.1", self.port)
        self.client.loop_start()
        return self

    def __exit__(self, *_: object) -> None:
        self.client.loop_stop()

    def wait(self, count: int, seconds: float) -> None:
        """Waits for `count` messages. Raises OperationError after `seconds`."""
        end = time.monotonic() + seconds
        while len(self.messages) < count:
            if time.monotonic() > end:
                raise OperationError(f"{self.topic}: {len(self.messages)} of {count} messages within {seconds:.0f} s")
            time.sleep(0.01)


@dataclass(frozen=True, slots=True)
class Cell:
    """Folder, database, model and broker of one sidecar."""

    logs: Path
    database: Path
    model: Path
    port: int

    def command(self, *more: str) -> list[str]:
        return [
            sys.executable, "-m", "acqd", "sidecar", str(self.logs), "--model", str(self.model), "--database",
            str(self.database), "--port", str(self.port), "--device", DEVICE, *more,
        ]  # fmt: skip

    def start(self, *more: str) -> subprocess.Popen[bytes]:
        return subprocess.Popen(self.command(*more), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    @contextmanager
    def running(self, *more: str) -> Iterator[subprocess.Popen[bytes]]:
        process = self.start(*more)
        try:
            yield process
        finally:
            process.terminate()
            process.wait()
