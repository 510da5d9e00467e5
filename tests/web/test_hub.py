"""Rows on their way to viewers, and who may look."""

from __future__ import annotations

import asyncio
import time

import orjson
import pytest

from acqd.telemetry.mqtt import BrokerAddress
from acqd.web.access import Access
from acqd.web.hub import Hub, _by_cause
from acqd.web.settings import token_for
from tests.storage.rows import row


def hub():
    return Hub(BrokerAddress("127.0.0.1", 1))


async def taken(events, count):
    return [await anext(events) for _ in range(count)]


def test_rows_are_sent_together_with_the_values_of_the_row():
    async def scenario():
        ours = hub()
        events = ours.events()
        first = await anext(events)
        sent = row(7, P=123.456)
        for payload in (sent.to_json(), b"no row", b'{"device":1}'):
            ours.take(f"acqd/{sent.device}/L1/power", payload)
        ours.take(f"acqd/{sent.device}/prediction/live", b'{"time": 5.0, "P_predicted": 1.5}')
        flushing = asyncio.create_task(ours._flush())
        texts = [first, *await taken(events, 2)]
        flushing.cancel()
        return sent, texts

    sent, (first, prediction, rows) = asyncio.run(scenario())
    assert first.startswith(b"retry") and prediction.startswith(b"event: prediction")
    (shown,) = orjson.loads(rows.partition(b"data: ")[2])
    assert (shown["P"], shown["seq"], shown["filetime"], shown["flags"]) == (123.456, 7, sent.filetime, sent.flags)


def test_the_wiring_of_a_device_and_of_every_box_is_told():
    ours = hub()
    one = {"findings": [], "phasors": {"U": [[230.0, 0.0]], "I": [[1.0, 0.0]]}}
    ours.take("acqd/pc/status", orjson.dumps({"device": "pc", "wiring": one}))
    ours.take("acqd/pc7/status", orjson.dumps({"device": "pc7", "boxes": {"press": {"wiring": one}, "mill": {}}}))
    ours.take("acqd/x/status", b"offline")
    told = [key for key in ours._state if key.startswith("wiring")]
    assert told == ["wiring pc", "wiring press"]


def test_a_viewer_who_falls_behind_loses_events_and_nobody_else_does():
    async def scenario():
        ours = hub()
        slow, quick = ours.events(), ours.events()
        await anext(slow), await anext(quick)
        seen = []
        for k in range(200):
            ours._tell("rows", [k])
            seen.append(await anext(quick))
        late = orjson.loads((await anext(slow)).partition(b"data: ")[2])
        lost, viewers = ours.lost, ours.viewers
        await slow.aclose()
        return seen, late, lost, viewers, ours.viewers

    seen, late, lost, viewers, left = asyncio.run(scenario())
    assert len(seen) == 200 and late == [150] and lost == 150 and (viewers, left) == (2, 1)


def test_an_alarm_is_known_to_new_viewers_until_it_is_cleared():
    async def scenario():
        ours, texts = hub(), []
        for payload in (b'{"chart": "level up", "onset_s": 5.0, "raised_s": 6.0, "log": "a"}', b"[1]", b"", b"{"):
            ours.take("acqd/cell/prediction/alarm", payload)
            events = ours.events()
            await anext(events)
            texts.append(orjson.loads((await anext(events)).partition(b"data: ")[2])["alarm"])
            await events.aclose()
        return texts

    raised, still, cleared, after = asyncio.run(scenario())
    assert raised == still == {"chart": "level up", "onset_s": 5.0, "raised_s": 6.0, "log": "a"}
    assert cleared is after is None


def test_a_live_prediction_keeps_causes_that_are_complete():
    split = {"causes": {"copper": 3}, "joints": [["copper", 1.5]]}
    assert _by_cause(split) == {"causes": {"copper": 3.0}, "joints": [("copper", 1.5)]}
    assert _by_cause(split | {"joints": [["tin", 1.0]]}) == _by_cause({}) == {}


def test_joints_become_a_posture_five_times_a_second_at_most():
    from acqd.web.posture import Posture

    arm = Posture("iiwa7_r800")
    for bad in (
        b"",
        b"[]",
        b"{}",
        b'{"q": [1, 2]}',
        b'{"q": [0, 0, 0, 0, 0, 0, NaN]}',
        b'{"q": ["a", 0, 0, 0, 0, 0, 0]}',
    ):
        assert arm.joints(bad) is None
    now = float(round(time.time()))
    for other_clock in (5.0, 1e3 * now, 1e9 * now, now - 7200):
        assert arm.joints(orjson.dumps({"time": other_clock, "q": [0] * 7})) is None and "Unix s" in arm.note
    said = orjson.dumps({"time": now, "q": [0, 0, 0, 0, 0, 0, 1.23456]})
    assert arm.joints(said) == {"time": now, "q": [0.0] * 6 + [1.2346]} and arm.note == ""
    assert arm.joints(b'{"q": [0, 0, 0, 0, 0, 0, 0]}')["time"] > 1.7e9
    assert len(arm.as_json()["frames"]["joints"]) == 7 and "copper" in arm.as_json()["colours"]
    assert Posture("").joints(b'{"q": []}') is None and Posture("no_such_robot").note

    async def scenario():
        ours = Hub(BrokerAddress("127.0.0.1", 1), arm)
        events = ours.events()
        await anext(events)
        for _ in range(10):
            ours.take("acqd/cell/joints", b'{"q": [0, 0, 0, 0, 0, 0, 0]}')
        ours._tell("end", {})
        return await taken(events, 2)

    posture, end = asyncio.run(scenario())
    assert posture.startswith(b"event: posture") and end.startswith(b"event: end")


@pytest.mark.parametrize(
    ("token", "host", "query", "cookie", "status"),
    [
        (None, "127.0.0.1:8731", "", "", 200), (None, "[::1]:8731", "", "", 200),
        (None, "evil.example", "", "", 403), ("secret", "plant:8731", "", "", 403),
        ("secret", "plant:8731", "token=wrong", "acqd=wrong", 403), ("secret", "plant:8731", "token=secret", "", 200),
        ("secret", "plant:8731", "", "acqd=secret", 200),
    ],
)  # fmt: skip
def test_who_may_look(token, host, query, cookie, status):
    headers = asyncio.run(asked(token, host, query, cookie))
    assert headers[0] == status
    assert any(b"acqd=secret" in value for value in headers[1]) == (status == 200 and query != "")


async def asked(token, host, query, cookie):
    async def app(scope, receive, send):
        await send({"type": "http.response.start", "status": 200, "headers": []})

    sent = []

    async def send(message):
        sent.append(message)

    async def receive():
        return {"type": "http.disconnect"}

    headers = [(b"host", host.encode()), (b"cookie", cookie.encode())]
    guard = Access(app, token=token, hosts=frozenset({"127.0.0.1", "localhost", "[::1]"}))
    scope = {"type": "http", "method": "GET", "path": "/", "headers": headers, "query_string": query.encode()}
    await guard(scope, receive, send)
    return sent[0]["status"], [value for name, value in sent[0]["headers"] if name == b"set-cookie"]


def test_a_token_is_made_where_others_can_reach_the_page():
    assert token_for("127.0.0.1", None) is None and token_for("localhost", None) is None
    assert token_for("127.0.0.1", "mine") == "mine"
    assert len(token_for("0.0.0.0", None)) >= 24 and token_for("plant", None) != token_for("plant", None)


def test_a_new_viewer_gets_the_states_of_more_devices_than_may_wait_for_one():
    async def scenario():
        ours = hub()
        for k in range(170):
            ours.take(f"acqd/cell{k}/status", b'{"state": "online"}')
            ours.take(f"acqd/cell{k}/prediction/alarm", b'{"chart": "cusum"}')
        return await taken(ours.events(), 341)

    texts = asyncio.run(scenario())
    assert len({text for text in texts if text.startswith(b"event: status")}) == 170
    assert len({text for text in texts if text.startswith(b"event: alarm")}) == 170
