"""The endpoints as a probe sees them."""

from __future__ import annotations

import contextlib
import json
import socket
import threading
from http.client import HTTPConnection

import pytest

from acqd.daemon.health.server import HealthServer
from acqd.daemon.health.snapshot import Link
from acqd.telemetry.broker import free_port
from tests.daemon.health.snapshots import daemon


class Served:
    """A server whose snapshot the test changes."""

    def __init__(self, host="127.0.0.1") -> None:
        self.now, self.host = daemon(), host
        self.server = HealthServer(host, 0, lambda: self.now)

    def get(self, path, method="GET", headers=None):
        connection = HTTPConnection(self.host, self.server.port, timeout=60)
        connection.request(method, path, headers=headers or {})
        answer = connection.getresponse()
        return answer.status, answer.read().decode()


@pytest.fixture
def served():
    served = Served()
    served.server.start()
    yield served
    served.server.stop()


def test_healthz_and_readyz_tell_a_dead_service_from_one_that_waits(served):
    assert served.get("/healthz")[0] == served.get("/readyz")[0] == 200
    served.now = daemon(broker=Link(False))
    assert served.get("/healthz")[0] == 200
    code, body = served.get("/readyz")
    assert code == 503 and json.loads(body)["problems"] == ["broker away"]
    served.now = daemon(alive=False)
    assert served.get("/healthz")[0] == 503


def test_an_address_of_ipv6_is_listened_on():
    served = Served("::1")
    served.server.start()
    assert served.get("/healthz")[0] == 200
    served.server.stop()


def test_status_and_metrics_are_served_and_nothing_else(served):
    code, body = served.get("/status")
    assert code == 200 and json.loads(body)["delivery"]["receipts_outstanding"] == 8
    code, body = served.get("/metrics?x=1")
    assert code == 200 and "acqd_rows_total" in body
    assert served.get("/")[0] == served.get("/../etc/passwd")[0] == 404
    assert served.get("/status", method="POST")[0] == 501


def test_clients_that_say_nothing_do_not_keep_others_out(served):
    silent = [socket.create_connection(("127.0.0.1", served.server.port)) for _ in range(4)]
    assert served.get("/healthz")[0] == 200
    for connection in silent:
        connection.close()


def test_requests_that_come_letter_by_letter_do_not_keep_others_out(served):
    slow, stopped = [socket.create_connection(("127.0.0.1", served.server.port)) for _ in range(12)], threading.Event()

    def speak():
        while not stopped.wait(0.2):
            for connection in slow:
                with contextlib.suppress(OSError):
                    connection.sendall(b"G")

    thread = threading.Thread(target=speak, daemon=True)
    thread.start()
    assert [served.get("/healthz")[0] for _ in range(10)] == [200] * 10
    stopped.set()
    thread.join()
    for connection in slow:
        connection.close()


@pytest.mark.parametrize(
    ("host", "code"),
    [("127.0.0.1:80", 200), ("localhost", 200), ("[::1]:9", 200), ("127.0.0.1.example.org", 421), ("127.x", 421)],
)
def test_only_names_of_this_computer_are_answered(served, host, code):
    assert served.get("/healthz", headers={"Host": host})[0] == code


def test_a_port_in_use_is_said_and_does_not_stop_the_service(caplog):
    caplog.set_level("INFO")
    port = free_port()
    with socket.create_server(("127.0.0.1", port)):
        server = HealthServer("127.0.0.1", port, daemon)
        server.start()
        assert server.port is None and str(port) in caplog.text
        server.stop()
