"""Plain numbers and Sparkplug B."""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path

import pytest

from acqd.integrations.plain import Plain
from acqd.integrations.sparkplug.node import Node
from acqd.integrations.sparkplug.payload import Metric, payload
from tests.integrations.messages import event, quality, status, summary
from tests.storage.rows import row

ACCEPTED = Path(__file__).with_name("sparkplug_accepted.json")
"""Payloads that pysparkplug 0.6.1 has decoded to these metrics: `decoded` below, run by hand."""
METRICS = [
    Metric("total/P", 539.3, 1_795_396_500_123), Metric("total/PF", None, 5), Metric("bdSeq", 255, 5, int),
    Metric("Node Control/Rebirth", False, 5, bool), Metric("ümläut", "gap simulated", 300, str),
    Metric("big", 2**62, 5, int),
]  # fmt: skip


def published(bridge, *messages):
    return [(each.topic, each.payload) for message in messages for each in bridge.take(*message)]


def test_every_quantity_of_a_summary_is_a_number_on_its_topic():
    found = dict(published(Plain("acqd"), summary(PF=None)))
    assert found["acqd/cell.1/total/P"] == b"539.3" and found["acqd/cell.1/total/W_import"] == b"0.5"
    assert "acqd/cell.1/total/PF" not in found and len(found) == 8


def test_a_quantity_that_ends_takes_its_retained_number_away_once():
    bridge = Plain("plant/power")
    published(bridge, summary())
    assert ("plant/power/cell.1/total/PF", b"") in published(bridge, summary(PF=None))
    assert "plant/power/cell.1/total/PF" not in dict(published(bridge, summary(PF=None)))


def test_numbers_of_every_row():
    sent, bridge = row(1, P=7.25), Plain("acqd", every_row=True)
    window = b"[" + row(2, P=8.0).to_json() + b"," + row(2, "total", P=9.0).to_json() + b"]"
    assert ("acqd/cell1/L1/P", b"7.25") in published(bridge, ("acqd/cell1/L1/power", sent.to_json()))
    numbers = published(bridge, ("acqd/cell1/window", window))
    assert ("acqd/cell1/L1/P", b"8.0") in numbers and ("acqd/cell1/total/P", b"9.0") in numbers


def test_power_quality_and_events_are_numbers_below_their_own_topics():
    bridge = Plain("acqd")
    found = dict(published(bridge, quality(), quality(aggregation="10/12", V_thds=9.0)))
    assert found["acqd/cell1/L1/quality/150-180/V_thds"] == b"2.5"
    assert found["acqd/cell1/L1/quality/150-180/V_h/3"] == b"5.0" and not any("10-12" in topic for topic in found)
    assert "acqd/cell1/L1/quality/150-180/V_h/2" not in found
    assert all(b'"quality"' not in each and topic.count("/") >= 5 for topic, each in found.items())
    begun, ended = (dict(published(bridge, event(duration))) for duration in (None, 0.1))
    assert begun["acqd/cell1/event/dip/active"] == b"1.0" and "acqd/cell1/event/dip/duration" not in begun
    assert ended["acqd/cell1/event/dip/active"] == b"0.0" and ended["acqd/cell1/event/dip/duration"] == b"0.1"
    assert published(bridge, (quality()[0], b"{}"), ("acqd/other/event", event()[1])) == []
    assert Plain("acqd", quality="off").subscriptions() == ("acqd/+/+/summary", "acqd/+/event")


@pytest.mark.parametrize("content", [b"", b"[]", summary("other")[1], summary(P="high")[1]])
def test_what_is_no_summary_makes_no_numbers(content):
    assert published(Plain("acqd"), (summary()[0], content)) == []
    assert published(Node("plant", "edge"), (summary()[0], content)) == []


def decoded(content, kind="DData"):
    import pysparkplug

    message = getattr(pysparkplug, kind).decode(content)
    return [[each.name, each.value, each.timestamp, each.datatype.name] for each in message.metrics]


def test_payloads_are_those_that_pysparkplug_has_decoded():
    accepted = json.loads(ACCEPTED.read_text())
    assert payload(1_795_396_500_200, METRICS, 7).hex() == accepted["payload"]
    names = {float: "DOUBLE", int: "INT64", bool: "BOOLEAN", str: "STRING"}
    assert accepted["metrics"] == [[each.name, each.value, each.time_ms, names[each.kind]] for each in METRICS]


@pytest.mark.skipif(importlib.util.find_spec("pysparkplug") is None, reason="needs pysparkplug (wants another paho)")
def test_pysparkplug_decodes_the_payload_now():
    assert decoded(payload(1_795_396_500_200, METRICS, 7)) == json.loads(ACCEPTED.read_text())["metrics"]


class Edge:
    """A node with a clock, and the kinds of its messages with their sequence numbers."""

    def __init__(self):
        self.now_s = 1_800_000_000.0
        self.node = Node("plant", "edge", 60.0, lambda: self.now_s)

    def kinds(self, messages):
        return [(each.topic.split("/")[2], each.topic.split("/")[4:], each.payload[-1]) for each in messages]

    def take(self, *message):
        return self.kinds(self.node.take(*message))


def test_births_data_and_deaths_in_sequence():
    edge = Edge()
    will = edge.node.will()
    assert will.topic == "spBv1.0/plant/NDEATH/edge" and b"bdSeq" in will.payload
    assert edge.kinds(edge.node.begin()) == [("NBIRTH", [], 0)]
    assert edge.take(*summary()) == [("DBIRTH", ["cell.1"], 1)]
    assert edge.take(*summary()) == [("DDATA", ["cell.1"], 2)]
    assert edge.take(*summary(channel="L1")) == [("DBIRTH", ["cell.1"], 3)]
    assert edge.take(*summary()) == [("DDATA", ["cell.1"], 4)]
    edge.now_s += 61
    assert edge.kinds(edge.node.tick()) == [("DDEATH", ["cell.1"], 5)] and edge.kinds(edge.node.tick()) == []
    assert edge.take(*summary()) == [("DBIRTH", ["cell.1"], 6)]


def test_a_daemon_that_goes_takes_its_devices_along_and_retained_summaries_do_not_revive_them():
    edge = Edge()
    edge.node.will(), list(edge.node.begin())
    edge.take(*status("hall", meters={"press-1": {}}))
    edge.take(*summary("press-1"))
    assert edge.take("acqd/hall/status", b"offline") == [("DDEATH", ["press-1"], 2)]
    assert edge.take(*summary("press-1")) == []
    edge.take(*status("hall", meters={"press-1": {}}))
    assert edge.take(*summary("press-1")) == [("DBIRTH", ["press-1"], 3)]


def test_power_quality_of_a_device_that_lives_is_born_once_and_then_data():
    edge = Edge()
    edge.node.will(), list(edge.node.begin())
    assert edge.take(*quality(device="cell.1")) == []  # a device is born with its summaries
    edge.take(*summary())
    (birth,) = edge.node.take(*quality(device="cell.1"))
    assert birth.topic.split("/")[2] == "DBIRTH"
    for name in (b"total/P", b"L1/quality/150-180/V_thds", b"L1/quality/150-180/V_h/3"):
        assert name in birth.payload  # everything that data may have
    (data,) = edge.node.take(*quality(device="cell.1", V_thds=None, f=50.0))
    assert data.topic.split("/")[2] == "DDATA" and b"total/P" not in data.payload
    assert edge.take(*quality(device="cell.1", aggregation="10/12")) == [] == edge.take(quality()[0], b"{}")
    assert Node("plant", "edge", quality="off").subscriptions()[1:] == ("acqd/+/status", "acqd/+/+/summary")


def test_a_rebirth_is_given_when_a_host_asks_and_sequence_numbers_wrap():
    edge = Edge()
    edge.node.will(), list(edge.node.begin())
    for _ in range(300):
        last = edge.take(*summary())
    assert last == [("DDATA", ["cell.1"], 300 - 256)]
    command = payload(5, [Metric("Node Control/Rebirth", True, 5, bool)])
    assert edge.take("spBv1.0/plant/NCMD/edge", command) == [("NBIRTH", [], 0), ("DBIRTH", ["cell.1"], 1)]
    assert edge.take("spBv1.0/plant/NCMD/edge", b"something else") == []
