"""The page that `acqd run` serves."""

from __future__ import annotations

import signal
import socket
import subprocess
from http.client import HTTPConnection

import pytest

from acqd.telemetry.broker import free_port
from tests.commands import ACQD
from tests.waiting import LIMIT_S, wait_for

pytest.importorskip("uvicorn")


def answers(port):
    try:
        connection = HTTPConnection("127.0.0.1", port, timeout=60)
        connection.request("GET", "/")
        return connection.getresponse().status == 200
    except OSError:
        return False


@pytest.fixture
def daemon(tmp_path):
    """A function that starts `acqd run` with the page on a port; its log is in tmp_path / "log"."""
    processes = []

    def start(port):
        config = tmp_path / "acqd.toml"
        config.write_text(
            "[mqtt]\nenabled = false\n[health]\nport = 0\n[realtime]\npriority = 0\n"
            f'[sink]\ndatabase = "{tmp_path}/power.sqlite"\n[web]\nenabled = true\nport = {port}\n'
        )
        with (tmp_path / "log").open("w") as said:
            processes.append(subprocess.Popen([*ACQD, "run", "--config", str(config)], stderr=said, cwd=tmp_path))
        return processes[0]

    yield start
    for process in processes:
        process.kill()


def test_the_page_comes_and_goes_with_the_daemon(daemon):
    port = free_port()
    process = daemon(port)
    wait_for(lambda: answers(port), "the page answers")
    process.send_signal(signal.SIGTERM)
    assert process.wait(LIMIT_S) == 0
    wait_for(lambda: not answers(port), "the page ends")


@pytest.mark.slow
def test_a_page_that_cannot_start_stops_nothing(daemon, tmp_path):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        process = daemon(taken.getsockname()[1])
        wait_for(lambda: "goes on without it" in (tmp_path / "log").read_text(), "the daemon says so")
    assert process.poll() is None and "Traceback" not in (tmp_path / "log").read_text()
    process.send_signal(signal.SIGTERM)
    assert process.wait(LIMIT_S) == 0
