"""The shipped configuration of a plant's mosquitto, on a real one: who gets in, and who may write what."""

from __future__ import annotations

import socket
import ssl
import subprocess
import warnings

import paho.mqtt.client as paho
import pytest
from paho.mqtt.enums import CallbackAPIVersion

from acqd.telemetry.broker import free_port
from acqd.telemetry.certificates import of_file
from acqd.telemetry.mqtt import BrokerAddress
from tests.places import ROOT
from tests.waiting import wait_for

USERS = ("box", "acqd-sink", "acqd-sidecar", "viewer", "acqd-bridge")


@pytest.fixture(scope="module")
def plant(tmp_path_factory):
    """Folder of certificates, and the port of a mosquitto with config/mosquitto-tls.conf."""
    folder = tmp_path_factory.mktemp("plant")
    certificates = ["sh", ROOT / "config" / "make-certificates.sh", folder, "127.0.0.1", *USERS]
    subprocess.run(certificates, check=True, capture_output=True)
    passwords = folder / "passwords"
    passwords.touch()
    for user in USERS:
        subprocess.run(["mosquitto_passwd", "-b", passwords, user, f"of-{user}"], check=True)
    port = free_port()
    text = (ROOT / "config" / "mosquitto-tls.conf").read_text()
    for old, new in (
        ("/etc/mosquitto/certs", str(folder)), ("/etc/mosquitto/acqd.passwords", str(passwords)),
        ("/etc/mosquitto/acqd.acl", str(ROOT / "config" / "mosquitto.acl")), ("listener 8883", f"listener {port}"),
    ):  # fmt: skip
        assert old in text
        text = text.replace(old, new)
    (folder / "m.conf").write_text(f"{text}persistence_location {folder}/\nuser root\n")
    with subprocess.Popen(["mosquitto", "-c", folder / "m.conf"], stderr=subprocess.DEVNULL) as broker:
        context = ssl.create_default_context(cafile=str(folder / "ca.pem"))

        def answers():
            try:
                ssl.get_server_certificate(("127.0.0.1", port), timeout=2)
            except ssl.SSLError:
                return True  # it wants a certificate from us
            except OSError:
                return False
            return True

        wait_for(answers, "mosquitto listens")
        assert context.verify_mode == ssl.CERT_REQUIRED
        yield folder, port
        broker.terminate()


class Client:
    """A connection as acqd makes them."""

    def __init__(self, plant, user, password=None, certificate=None):
        folder, port = plant
        names = {"cert_file": folder / f"{certificate}.pem", "key_file": folder / f"{certificate}.key"}
        files = names if certificate else {}
        address = BrokerAddress("127.0.0.1", port, user, password, True, folder / "ca.pem", **files)
        self.answers, self.messages, self.acknowledged = [], [], []
        self.client = paho.Client(CallbackAPIVersion.VERSION2, reconnect_on_failure=False)
        if user:
            self.client.username_pw_set(user, password)
        self.client.tls_set_context(address.tls_context())
        self.client.on_connect = lambda _c, _d, _f, reason, _p: self.answers.append(reason)
        self.client.on_message = lambda _c, _d, message: self.messages.append((message.topic, message.payload))
        self.client.on_publish = lambda *_: self.acknowledged.append(1)
        self.client.on_subscribe = lambda _c, _d, _m, reasons, _p: self.answers.append(reasons[0])
        self.client.connect(address.host, address.port)
        self.client.loop_start()
        wait_for(lambda: self.answers, "CONNACK")

    @property
    def inside(self):
        return bool(self.answers) and not self.answers[0].is_failure

    def subscribe(self, topic):
        self.client.subscribe(topic, qos=1)
        wait_for(lambda: len(self.answers) > 1, "SUBACK")
        return self

    def publish(self, *topics):
        for topic in topics:
            self.client.publish(topic, b"{}", qos=1)
        wait_for(lambda: len(self.acknowledged) >= len(topics), "PUBACK")


def test_only_a_password_and_a_certificate_of_the_plant_open_the_door(plant):
    assert Client(plant, "box", "of-box", "box").inside
    assert not Client(plant, "box", "wrong", "box").inside
    assert not Client(plant, None, None, "box").inside  # anonymous


def test_certificates_of_a_plant_end_on_different_days_and_the_brokers_last(plant):
    folder, _ = plant
    days = [of_file(folder / f"{name}.pem").ends.date() for name in (*USERS[::-1], "broker")]
    assert days == sorted(set(days))


def test_without_a_certificate_there_is_no_connection(plant):
    folder, port = plant
    context = BrokerAddress("127.0.0.1", port, tls=True, ca_file=folder / "ca.pem").tls_context()
    with (
        pytest.raises(OSError),
        context.wrap_socket(socket.create_connection(("127.0.0.1", port)), server_hostname="127.0.0.1") as wrapped,
    ):
        wrapped.settimeout(5)
        wrapped.sendall(b"\x10\x0c\x00\x04MQTT\x04\x02\x00\x3c\x00\x00")
        if not wrapped.recv(1):  # closed by the broker
            raise OSError("closed")


def test_old_versions_of_tls_are_refused(plant):
    _, port = plant
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
    context.check_hostname, context.verify_mode = False, ssl.CERT_NONE
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)
        context.minimum_version, context.maximum_version = ssl.TLSVersion.TLSv1, ssl.TLSVersion.TLSv1_1
    context.set_ciphers("ALL:@SECLEVEL=0")  # this side would allow it
    with socket.create_connection(("127.0.0.1", port)) as plain, pytest.raises(OSError, match=r"(?i)version|protocol"):
        context.wrap_socket(plain)


def test_a_device_writes_its_own_rows_and_no_receipts(plant):
    viewer = Client(plant, "viewer", "of-viewer", "viewer").subscribe("acqd/#")
    own = ["acqd/box/L1/power", "acqd/box/L1/summary", "acqd/box/status"]
    Client(plant, "box", "of-box", "box").publish(
        "acqd/other/L1/power", "acqd/box/receipt", "acqd/other/status", "acqd/box/prediction", *own
    )
    wait_for(lambda: len(viewer.messages) >= 3, "the viewer hears the device")
    assert [topic for topic, _ in viewer.messages] == own
    viewer.messages.clear()
    Client(plant, "acqd-sink", "of-acqd-sink", "acqd-sink").publish("acqd/box/L1/power", "acqd/box/receipt")
    Client(plant, "viewer", "of-viewer", "viewer").publish("acqd/box/L1/power")
    Client(plant, "acqd-sidecar", "of-acqd-sidecar", "acqd-sidecar").publish(
        "acqd/box/receipt", "acqd/box/prediction", "acqd/box/prediction/alarm"
    )
    wait_for(lambda: len(viewer.messages) >= 3, "the viewer hears sink and sidecar")
    heard = [topic for topic, _ in viewer.messages]
    assert heard == ["acqd/box/receipt", "acqd/box/prediction", "acqd/box/prediction/alarm"]


def test_a_large_message_ends_the_connection(plant):
    client = Client(plant, "box", "of-box", "box")
    client.client.publish("acqd/box/L1/power", b"x" * 300_000, qos=1)
    wait_for(lambda: not client.client.is_connected(), "mosquitto hangs up")


def test_a_bridge_writes_for_other_programs_and_no_rows(plant):
    hears = Client(plant, "acqd-bridge", "of-acqd-bridge", "acqd-bridge").subscribe("homeassistant/#")
    viewer = Client(plant, "viewer", "of-viewer", "viewer").subscribe("acqd/#")
    own = ["acqd/alarms/active", "acqd/box/total/P"]
    Client(plant, "acqd-bridge", "of-acqd-bridge", "acqd-bridge").publish(
        "acqd/box/L1/power", "acqd/box/window", "acqd/box/receipt", "acqd/box/status", "acqd/box/prediction",
        "acqd/alarms/acknowledge", "homeassistant/sensor/acqd_box/L1_P/config", *own,
    )  # fmt: skip
    wait_for(lambda: len(viewer.messages) >= 2 and hears.messages, "the viewer hears the bridge")
    assert [topic for topic, _ in viewer.messages if topic.count("/") > 1] == own
