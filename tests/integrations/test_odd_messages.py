"""Messages of a stranger, with values of wrong types, end no consumer."""

from __future__ import annotations

import orjson
import pytest

from acqd.cli.watched import Watched
from acqd.integrations.alarms.book import Book
from acqd.integrations.alarms.watch import AlarmWatch
from acqd.integrations.homeassistant.discovery import Discovery
from acqd.integrations.plain import Plain
from acqd.integrations.sparkplug.node import Node
from acqd.plant.heard import Heard
from acqd.telemetry.mqtt import BrokerAddress
from acqd.web.hub import Hub

ODD = (None, True, -1, 1.5, 1e308, 2**63, "x", "", [], {}, [[1]], [None], {"a": 1})
NUMBERS = ("W", "W_import", "W_export", "Vrms", "Irms", "P", "S", "PF", "f", "P_min", "P_max")
SUMMARY = dict.fromkeys(NUMBERS, 1.0) | {
    "device": "cell1", "channel": "L1", "boot": "b", "seq": 1, "time": "2026-01-01T00:00:00Z", "flags": [], "schema": 1,
}  # fmt: skip
STATUS = {
    "state": "online", "device": "cell1", "boot": "b", "version": "1", "host": "h", "problems": [], "health": "ready",
    "source": {"connected": True, "trouble": ""}, "boxes": {"x": {"wiring": {"phasors": [1]}}}, "meters": {"m": {}},
}  # fmt: skip
ALARM = {"chart": "c", "onset_s": 1.0, "raised_s": 2.0, "log": "x"}
MESSAGES = {
    "acqd/cell1/L1/summary": SUMMARY,
    "acqd/cell1/status": STATUS,
    "acqd/cell1/prediction/alarm": ALARM,
    "acqd/cell1/prediction/live": {"time": 1.0, "P_predicted": 2.0},
}
CONSUMERS = {
    "watch": lambda: Watched("127.0.0.1:1883"),
    "plant": Heard,
    "plain": lambda: Plain("p"),
    "Home Assistant": Discovery,
    "Sparkplug": lambda: Node("g", "n"),
    "alarms": lambda: AlarmWatch(Book(60.0), lambda _: None, 0.0),
    "page": lambda: Hub(BrokerAddress()),
}


@pytest.mark.parametrize("make", CONSUMERS.values(), ids=CONSUMERS)
def test_values_of_wrong_types_end_no_consumer(make):
    consumer = make()
    for topic, right in MESSAGES.items():
        for content in [*ODD, *({**right, key: value} for key in right for value in ODD), right]:
            answers = consumer.take(topic, orjson.dumps(content))
            list(answers if isinstance(answers, (list, tuple)) or hasattr(answers, "__next__") else ())
    if isinstance(consumer, Watched):
        assert consumer.summaries and consumer.table()
