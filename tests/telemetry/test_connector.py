"""MQTT_CONNECTOR against a real mosquitto."""

from __future__ import annotations

import asyncio
import json
import shutil
import signal
import subprocess

import aiomqtt
import pytest

from acqd.daemon.publish import Publisher
from acqd.errors import UserError
from acqd.telemetry.mqtt import BrokerAddress
from acqd.telemetry.rights import refused
from tests.telemetry.clients import collect, connector, delivery, put, stop
from tests.waiting import finish, until


def test_connector_starts_without_a_broker_and_loses_nothing_when_it_goes_away(mosquitto):
    mosquitto.stop()

    async def scenario():
        outbox = delivery()
        running = asyncio.create_task(connector(BrokerAddress(port=mosquitto.port), outbox).run())
        sent = 0

        def send(count):
            nonlocal sent
            put(outbox, range(sent, sent + count))
            sent += count

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
        assert outbox.spool.dropped == 0
        await stop(viewer)
        await stop(running)

    finish(scenario())


def test_status_is_retained_and_the_last_will_says_offline(mosquitto):
    async def scenario():
        address = BrokerAddress(port=mosquitto.port)
        speaker = connector(address, delivery())
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


def test_connections_that_end_within_seconds_are_said_until_one_lasts(mosquitto, monkeypatch):
    monkeypatch.setattr("acqd.telemetry.connector._SHORT_S", 2.0)

    async def scenario():
        speaker = connector(BrokerAddress(port=mosquitto.port), delivery())
        running = asyncio.create_task(speaker.run())
        for _ in range(3):
            await until(lambda: speaker.state == "connected", "the connection")
            async with aiomqtt.Client("127.0.0.1", mosquitto.port, identifier="acqd-t"):  # takes the name
                await until(lambda: speaker.state == "connecting", "its end")
        assert "connections end within seconds" in speaker.trouble
        await until(lambda: speaker.state == "connected" and not speaker.trouble, "a connection that lasts")
        await stop(running)

    finish(scenario())


def test_a_refused_password_is_said_and_tried_again(mosquitto, caplog):
    mosquitto.stop()
    passwords = mosquitto.folder / "passwords"
    passwords.touch(mode=0o600)

    def allow(password):
        subprocess.run(["mosquitto_passwd", "-b", passwords, "acqd", password], check=True)

    allow("other")
    mosquitto.extra = f"allow_anonymous false\npassword_file {passwords}\n"
    mosquitto.start()

    async def scenario():
        address = BrokerAddress(port=mosquitto.port, username="acqd", password="right")
        outbox = delivery()
        put(outbox, range(5))
        speaker = connector(address, outbox)
        running = asyncio.create_task(speaker.run())
        await until(lambda: "refused the connection" in caplog.text, "the refusal is said")
        await asyncio.sleep(1.0)
        assert not running.done() and len(outbox) == 5
        assert caplog.text.count("refused the connection") == 1
        allow("right")
        mosquitto.process.send_signal(signal.SIGHUP)
        await until(lambda: not len(outbox), "the rows are delivered")
        await stop(running)

    finish(scenario())


def test_a_playback_ends_where_the_broker_refuses_its_password(mosquitto):
    mosquitto.stop()
    mosquitto.extra = "allow_anonymous false\n"
    mosquitto.start()
    with (
        pytest.raises(UserError, match="refused the connection"),
        Publisher(BrokerAddress(port=mosquitto.port, username="a", password="b"), "t"),
    ):
        pass


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
        outbox = delivery()
        put(outbox, [0])
        address = BrokerAddress(port=mosquitto.port, tls=True, ca_file=folder / "ca.pem")
        shutil.copy(folder / "cert.pem", folder / "ca.pem")
        sending = connector(address, outbox)
        (folder / "ca.pem").write_text("half writ")
        running = asyncio.create_task(sending.run())
        await until(lambda: "ca_file" in sending.trouble, "the file that is being replaced is named")
        assert await refused(address, "t-rights", "t", []) is None, "and stops nobody"
        shutil.copy(folder / "cert.pem", folder / "ca.pem")
        await until(lambda: not len(outbox), "the broker has everything")
        assert not sending.trouble
        await stop(running)

    finish(scenario())
    with pytest.raises(UserError, match="ca_file"):
        BrokerAddress(tls=True, ca_file=folder / "none.pem").tls_context()


def test_a_broker_that_goes_silent_is_left_and_nothing_is_lost(mosquitto, monkeypatch):
    monkeypatch.setattr("acqd.telemetry.patience.LEAST_S", 0.3)

    async def scenario():
        outbox = delivery()
        speaker = connector(BrokerAddress(port=mosquitto.port), outbox)
        running = asyncio.create_task(speaker.run())
        put(outbox, range(10))
        await until(lambda: not len(outbox), "the broker has the first rows")
        mosquitto.process.send_signal(signal.SIGSTOP)
        put(outbox, range(10, 20))
        await until(lambda: speaker.state == "connecting", "the silence is noticed")
        assert len(outbox) == 10
        mosquitto.process.send_signal(signal.SIGCONT)
        await until(lambda: not len(outbox), "the broker has the others")
        await stop(running)

    finish(scenario())
