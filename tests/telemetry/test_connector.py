"""MQTT_CONNECTOR against a real mosquitto."""

from __future__ import annotations

import asyncio
import json
import subprocess

import pytest

from acqd.errors import UserError
from acqd.telemetry.mqtt import BrokerAddress
from acqd.telemetry.outbox import MemoryOutbox, Message
from tests.telemetry.clients import collect, connector, stop
from tests.waiting import finish, until


def test_connector_starts_without_a_broker_and_loses_nothing_when_it_goes_away(mosquitto):
    mosquitto.stop()

    async def scenario():
        outbox = MemoryOutbox(10_000)
        running = asyncio.create_task(connector(BrokerAddress(port=mosquitto.port), outbox).run())
        sent = 0

        def send(count):
            nonlocal sent
            for _ in range(count):
                outbox.put(Message("acqd/t/L1/power", str(sent).encode()))
                sent += 1

        send(100)
        await asyncio.sleep(0.3)
        assert len(outbox) == 100
        await asyncio.to_thread(mosquitto.start)
        received, ready = [], asyncio.Event()
        # A persistent subscriber session: the broker keeps for it what it had accepted.
        options = {"identifier": "viewer", "clean_session": False}
        viewer = asyncio.create_task(collect(mosquitto.port, "acqd/t/+/power", 10**9, received, ready, **options))
        await ready.wait()
        send(200)
        await until(lambda: not len(outbox), "the broker has everything")
        await asyncio.to_thread(mosquitto.stop)
        await asyncio.gather(viewer, return_exceptions=True)
        send(200)
        await asyncio.sleep(0.3)
        await asyncio.to_thread(mosquitto.start)
        viewer = asyncio.create_task(collect(mosquitto.port, "acqd/t/+/power", 10**9, received, **options))
        await until(lambda: not len(outbox), "the broker has everything")
        wanted = {str(k).encode() for k in range(100, 500)}
        await until(lambda: not wanted - {payload for _, payload, _ in received}, "nothing was lost")
        assert outbox.dropped == 0
        await stop(viewer)
        await stop(running)

    finish(scenario())


def test_status_is_retained_and_the_last_will_says_offline(mosquitto):
    async def scenario():
        outbox = MemoryOutbox(10)
        address = BrokerAddress(port=mosquitto.port)
        speaker = connector(address, outbox)
        running = asyncio.create_task(speaker.run())
        await until(lambda: speaker.state == "connected", "the connection")
        seen = []
        await collect(mosquitto.port, "acqd/t/status", 1, seen)
        assert json.loads(seen[0][1]) == {"state": "online"}
        await stop(running)
        seen.clear()
        await collect(mosquitto.port, "acqd/t/status", 1, seen)
        assert seen == [("acqd/t/status", b"offline", True)]

    finish(scenario())


def test_a_refused_password_is_a_user_error(mosquitto):
    mosquitto.stop()
    passwords = mosquitto.folder / "passwords"
    passwords.touch(mode=0o600)
    subprocess.run(["mosquitto_passwd", "-b", passwords, "acqd", "right"], check=True)
    mosquitto.extra = f"allow_anonymous false\npassword_file {passwords}\n"
    mosquitto.start()

    async def attempt(password):
        address = BrokerAddress(port=mosquitto.port, username="acqd", password=password)
        speaker = connector(address, MemoryOutbox(10))
        running = asyncio.create_task(speaker.run())
        await until(lambda: speaker.state == "connected" or running.done(), "an answer of the broker")
        if running.done():
            running.result()
        await stop(running)

    finish(attempt("right"))
    with pytest.raises(UserError, match="refused the connection"):
        finish(attempt("wrong"))


def test_tls_with_a_private_ca(mosquitto):
    folder = mosquitto.folder
    subprocess.run(
        ["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2", "-keyout", "key.pem", "-out",
         "cert.pem", "-subj", "/CN=127.0.0.1", "-addext", "subjectAltName=IP:127.0.0.1"],
        cwd=folder, check=True, capture_output=True,
    )  # fmt: skip
    mosquitto.stop()
    mosquitto.extra = f"allow_anonymous true\ncertfile {folder}/cert.pem\nkeyfile {folder}/key.pem\n"
    mosquitto.start()

    async def scenario():
        outbox = MemoryOutbox(10)
        outbox.put(Message("acqd/t/L1/power", b"x"))
        address = BrokerAddress(port=mosquitto.port, tls=True, ca_file=folder / "cert.pem")
        running = asyncio.create_task(connector(address, outbox).run())
        await until(lambda: not len(outbox), "the broker has everything")
        await stop(running)

    finish(scenario())
    with pytest.raises(UserError, match="ca_file"):
        BrokerAddress(tls=True, ca_file=folder / "none.pem").tls_context()
