"""The sink's connection against a real mosquitto."""

from __future__ import annotations

import select
import signal
import subprocess
from types import SimpleNamespace

import pytest

from acqd.telemetry import subscriber as module
from acqd.telemetry.certificates import of_file
from acqd.telemetry.mqtt import BrokerAddress
from acqd.telemetry.subscriber import Subscriber, SubscriberError
from acqd.telemetry.wire import V5, V311, Hello
from tests.waiting import wait_for


def hello(version=V5, keep_alive_s=10, **names):
    return Hello(
        version, "t", keep_alive_s, names.get("username"), names.get("password"), "t/will", b"gone", 60, 100, 4096
    )


def connect(address, greeting):
    made = Subscriber(address, greeting)
    made.connect()
    return made


def echo(made, payload):
    """Send a message to itself and take it."""
    made.subscribe("t/a")
    got = []
    wait_for(lambda: got.extend(made.receive(0.05)) or made.subscribed, "the subscription")
    made.publish("t/a", payload)
    wait_for(lambda: got.extend(made.receive(0.05)) or got, "the message")
    return got[0].payload


@pytest.mark.parametrize("version", [V311, V5])
def test_messages_with_password_and_tls(mosquitto, version):
    folder = mosquitto.folder
    subprocess.run(
        ["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2", "-keyout", "key.pem", "-out",
         "cert.pem", "-subj", "/CN=127.0.0.1", "-addext", "subjectAltName=IP:127.0.0.1"],
        cwd=folder, check=True, capture_output=True,
    )  # fmt: skip
    (folder / "passwords").touch(mode=0o600)
    subprocess.run(["mosquitto_passwd", "-b", folder / "passwords", "acqd", "right"], check=True)
    mosquitto.stop()
    mosquitto.extra = (
        f"allow_anonymous false\npassword_file {folder}/passwords\n"
        f"certfile {folder}/cert.pem\nkeyfile {folder}/key.pem\n"
    )
    mosquitto.start()
    address = BrokerAddress(port=mosquitto.port, tls=True, ca_file=folder / "cert.pem")
    made = connect(address, hello(version, username="acqd", password="right"))
    assert echo(made, b"x" * 3000) == b"x" * 3000
    assert made.certificate == of_file(folder / "cert.pem")
    made.close()
    with pytest.raises(SubscriberError, match=r"bad user name or password|not authorized"):
        connect(address, hello(version, username="acqd", password="wrong"))
    with pytest.raises(SubscriberError, match="certificate"):
        connect(BrokerAddress(port=mosquitto.port, tls=True), hello(version))


def test_a_broker_that_goes_silent_is_noticed(mosquitto, monkeypatch):
    monkeypatch.setattr(module, "_SILENT_S", 0.3)
    made = connect(BrokerAddress(port=mosquitto.port), hello(keep_alive_s=1))
    assert echo(made, b"1") == b"1"
    for _ in range(15):  # answered pings keep it alive
        made.receive(0.1)
    mosquitto.process.send_signal(signal.SIGSTOP)
    try:
        with pytest.raises(SubscriberError, match="no answer to a ping"):
            for _ in range(1000):
                made.receive(0.1)
    finally:
        mosquitto.process.send_signal(signal.SIGCONT)


def test_an_answer_that_this_process_has_not_read_yet_is_an_answer(mosquitto, monkeypatch):
    clock = SimpleNamespace(monotonic=lambda: now)
    now = 0.0
    monkeypatch.setattr(module, "time", clock)
    made = connect(BrokerAddress(port=mosquitto.port), hello())
    for _ in range(50):
        now += 6.0
        made.receive(0.0)  # a ping goes out, whose answer may be read at once
        if select.select([made._socket], [], [], 0.5)[0]:
            break
    else:
        pytest.fail("every answer was read at once")
    now += 60.0  # the computer was asleep, or had other work
    assert made.receive(0.0) == []
    made.close()


def test_a_port_where_nobody_or_somebody_else_listens(mosquitto):
    mosquitto.stop()
    with pytest.raises(SubscriberError, match="refused"):
        connect(BrokerAddress(port=mosquitto.port), hello())
