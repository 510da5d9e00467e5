"""Discovery messages: those that Home Assistant has accepted, for every device that shows itself."""

from __future__ import annotations

import asyncio
import json
from fractions import Fraction
from pathlib import Path
from zoneinfo import ZoneInfo

import aiomqtt
import orjson
import pytest

from acqd import __version__
from acqd.energy.account import Period
from acqd.energy.running import Price, Running
from acqd.integrations.bridge import Relay
from acqd.integrations.daemons import Daemons
from acqd.integrations.homeassistant.discovery import Discovery
from acqd.integrations.homeassistant.entities import node
from acqd.integrations.homeassistant.removal import Removal
from acqd.telemetry.mqtt import BrokerAddress
from tests.integrations.messages import quality, status, summary
from tests.waiting import finish, until

ACCEPTED = Path(__file__).with_name("homeassistant_accepted.json")
"""Written by `python -m tools.studies.homeassistant --captured`: these became entities of the right kind."""


def announced(*messages, **settings):
    discovery = Discovery(**settings)
    discovery.begin()
    return {sent.topic: orjson.loads(sent.payload) for message in messages for sent in discovery.take(*message)}


def test_messages_are_those_that_home_assistant_has_accepted():
    accepted = json.loads(ACCEPTED.read_text())
    phases = ("L1", "L2", "L3")
    distortion = [quality(phase, device="cell.1") for phase in phases]
    unbalance = quality("total", device="cell.1", V_thds=None, I_thds=None, V_u2=0.1)
    summaries = [summary(channel=channel) for channel in (*phases, "total")]
    made = announced(status("cell.1", events=["cell.1"]), *summaries, *distortion, unbalance)
    for message in accepted.values():
        message["origin"]["sw_version"] = __version__
    assert made == accepted and len(made) == 44


def test_a_channel_is_announced_once_and_again_when_its_daemon_shows_itself():
    discovery = Discovery()
    first, again = list(discovery.take(*summary())), list(discovery.take(*summary(P=1.0)))
    assert len(first) == 9 and not again and all(message.retain for message in first)
    assert not any(b"availability" in message.payload for message in first)
    discovery.take(*status("cell.1"))
    changed = list(discovery.take(*summary()))
    assert {message.topic for message in changed} == {message.topic for message in first}
    assert orjson.loads(changed[0].payload)["availability_topic"] == "acqd/cell.1/status"


def test_a_quantity_without_values_is_no_entity():
    made = announced(summary(S=None, W_export=None))
    assert len(made) == 7 and not any("W_export" in topic or "total_S/" in topic for topic in made)


def test_distortion_and_unbalance_are_entities_of_the_shortest_aggregation_that_is_slow_enough():
    made = announced(quality(aggregation="10/12"), quality(aggregation="10min"), quality("total", V_u2=1.5))
    assert {topic.split("/")[3] for topic in made} == {"L1_V_thds", "L1_I_thds", "total_V_thds", "total_I_thds",
                                                      "total_V_u2"}  # fmt: skip
    slow = made["homeassistant/sensor/acqd_cell1/L1_V_thds/config"]
    assert "'10min'" in slow["value_template"] and slow["expire_after"] == 3000
    assert slow["state_topic"] == "acqd/cell1/L1/quality" and slow["unit_of_measurement"] == "%"
    discovery = Discovery()
    first = list(discovery.take(*quality()))
    assert len(first) == 2 and b"'150/180'" in first[0].payload and b'"expire_after":60' in first[0].payload
    assert not list(discovery.take(*quality(aggregation="10min"))) and not list(discovery.take(*quality()))


def test_a_daemon_that_watches_the_voltage_has_event_entities():
    discovery = Discovery()
    (sent,) = discovery.take(*status("hall", events=["press-1"]))
    content = orjson.loads(sent.payload)
    assert sent.topic == "homeassistant/event/acqd_press-1/voltage/config" and sent.retain
    assert content["state_topic"] == "acqd/press-1/event" and "dip" in content["event_types"]
    assert content["availability_topic"] == "acqd/hall/status"
    assert not list(discovery.take(*status("hall", events=["press-1"])))
    assert not list(discovery.take(*status("hall", events=[3, "a/b"]))) and not list(discovery.take(*status("x")))
    (gone,) = Removal().take(sent.topic, sent.payload)
    assert (gone.topic, gone.payload) == (sent.topic, b"")


MIDNIGHT = 1_795_647_600  # 2026-11-26 in Berlin


def running(since, EUR, price=0.25):
    def period(begin, cost):
        values = {"begin": begin, "end": begin + 3600, "nWh": 2 * 10**12, "known_s": 3600.0, "mean_W": 2e3,
                  "max_W": 2e3, "demand": None, "unpriced_nWh": 0, "co2_kg": None, "no_co2_nWh": 0,
                  "standby_nWh": 10**12}  # fmt: skip
        return Period(**values, cost=cost)

    today, yesterday = period(since, EUR), period(since - 86_400, Fraction(7, 2))
    now = None if price is None else Price(price, 0.08)
    return Running("cell.1", ZoneInfo("Europe/Berlin"), today, yesterday, today, yesterday, now)


def test_costs_are_entities_of_the_energy_dashboard_and_a_day_is_completed_at_midnight():
    news = []
    discovery = Discovery(energies=lambda: news.pop() if news else None)
    assert not list(discovery.tick())
    news.append([running(MIDNIGHT, Fraction(1, 2))])
    *configurations, state = discovery.tick()
    made = {message.topic: orjson.loads(message.payload) for message in configurations}
    cost = made[f"homeassistant/sensor/acqd_{node('cell.1')}/cost_today/config"]
    assert (cost["device_class"], cost["state_class"], cost["unit_of_measurement"]) == ("monetary", "total", "EUR")
    assert cost["state_topic"] == state.topic == "acqd/cell.1/energy" and state.retain and cost["expire_after"] == 300
    price = made[f"homeassistant/sensor/acqd_{node('cell.1')}/price/config"]
    assert price["unit_of_measurement"] == "EUR/kWh" and len(made) == 3
    content = orjson.loads(state.payload)
    assert content["today"] == {
        "kWh": 2.0, "EUR": 0.5, "unpriced_kWh": 0.0, "missing_s": 0.0, "since": "2026-11-26T00:00:00+01:00",
    }  # fmt: skip
    assert (content["price"], content["standby_percent"]) == (0.25, 50.0)
    news.append([running(MIDNIGHT + 86_400, Fraction(0))])
    completed, after = (orjson.loads(message.payload)["today"] for message in discovery.tick())
    assert (completed["EUR"], completed["since"][:10], after["since"][:10]) == (3.5, "2026-11-26", "2026-11-27")
    (gone,) = Removal().take(configurations[0].topic, configurations[0].payload)
    assert gone.payload == b""


def test_without_a_price_no_cost_is_announced():
    discovery = Discovery(energies=lambda: [running(MIDNIGHT, None, None)])
    names = [message.topic.split("/")[-2] for message in discovery.tick() if message.topic.endswith("/config")]
    assert names == ["standby_share"]


@pytest.mark.parametrize("payload", [b"", b"{", b"[]", b"null", b'{"device": "cell.1"}', summary("other")[1]])
def test_messages_that_are_no_summaries_of_their_topic_are_ignored(payload):
    assert not announced((summary()[0], payload))


def test_different_devices_have_different_nodes():
    names = ["a.b", "a-b", "a_b", "a b", "ä"]
    assert len({node(name) for name in names}) == len(names) and node("press-1") == "press-1"


@pytest.mark.parametrize(
    "content",
    [
        {"meters": {"press-1": {}}},
        {"boxes": {"press-1": {}}},
        {"boxes": {"": {"meters": {"press-1": {}}}}},
        {"boot": "b1"},
    ],
)
def test_a_device_with_another_name_than_its_daemon_is_available_with_it(content):
    daemons = Daemons()
    daemons.take("hall", orjson.dumps({"boot": "other"} | content))
    daemons.take("elsewhere", b"offline")
    assert daemons.of("press-1", "b1") == "hall" and daemons.of("press-2") is None
    daemons.take("hall", b"offline")
    assert daemons.of("press-1", "b1") == "hall"


def test_entities_are_announced_and_removed_through_a_broker_and_others_stay(mosquitto):
    address = BrokerAddress(port=mosquitto.port)
    foreign = "homeassistant/sensor/other/x/config"

    async def retained(client, found):
        async for message in client.messages:
            found[str(message.topic)] = message.payload

    async def relay(bridge, done):
        stop = asyncio.Event()
        task = asyncio.create_task(Relay(address, bridge, "test").run(stop))
        await until(done, "relayed")
        stop.set()
        await task

    async def scenario():
        found = {}
        async with aiomqtt.Client("127.0.0.1", mosquitto.port) as client:
            await client.subscribe("homeassistant/#", qos=1)
            listening = asyncio.create_task(retained(client, found))
            await client.publish(foreign, b'{"origin":{"name":"other"}}', 1, retain=True)
            for message in (status("cell.1"), summary(), summary("b", "L1")):
                await client.publish(*message, qos=1, retain=True)
            await relay(Discovery(), lambda: len(found) == 19)
            only = Removal(device="b")
            await relay(only, lambda: sum(payload == b"" for payload in found.values()) == 9)
            await relay(Removal(), lambda: sum(payload == b"" for payload in found.values()) == 18)
            listening.cancel()
        assert only.removed == 9 and found[foreign]

    finish(scenario())
