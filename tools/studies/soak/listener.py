"""A plain subscriber next to the sink: when every row came, and in which order."""

from __future__ import annotations

import threading
import time
from collections import defaultdict
from collections.abc import Iterable
from datetime import datetime

import orjson

from acqd.telemetry.mqtt import BrokerAddress
from acqd.telemetry.subscriber import Subscriber
from acqd.telemetry.wire import V311, Hello


class Listener:
    """Collects the rows of a device until it is stopped."""

    def __init__(self, port: int, device: str) -> None:
        hello = Hello(V311, "soak-listener", 30, None, None, "soak/will", b"", 0, 0, 1 << 16)
        self._subscriber = Subscriber(BrokerAddress(port=port), hello)
        self._subscriber.connect()
        self._subscriber.subscribe(f"acqd/{device}/+/power")
        self.numbers: dict[str, list[int]] = defaultdict(list)
        """seq per channel, in the order of arrival."""
        self.late: list[tuple[float, float]] = []
        """Time of a row (Unix) and how long after it the row came [s]."""
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Leave the broker."""
        self._stopped.set()
        self._thread.join()
        self._subscriber.close()

    def _run(self) -> None:
        while not self._stopped.is_set():
            messages, now = self._subscriber.receive(0.05), time.time()
            for message in messages:
                row = orjson.loads(message.payload)
                self.numbers[row["channel"]].append(row["seq"])
                made = datetime.fromisoformat(row["time"]).timestamp()
                self.late.append((made, now - made))
            self._subscriber.acknowledge([message.number for message in messages])


def out_of_order(numbers: Iterable[int]) -> int:
    """Numbers that are in neither of two rising sequences (backlog and new rows); repetitions do not count."""
    seen: set[int] = set()
    tails = [-1, -1]
    wrong = 0
    for number in numbers:
        if number in seen:
            continue
        seen.add(number)
        fitting = max((tail for tail in tails if tail < number), default=None)
        if fitting is None:
            wrong += 1
        else:
            tails[tails.index(fitting)] = number
    return wrong
