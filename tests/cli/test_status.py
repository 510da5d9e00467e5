"""`acqd status` on services that work, wait, are not there, or are somebody else's."""

from __future__ import annotations

import json
import os
import signal
import socket
import time
from pathlib import Path

import pytest

from acqd.daemon.health.server import HealthServer
from acqd.daemon.health.snapshot import Link
from acqd.telemetry.broker import free_port
from tests.commands import acqd_here, refused, start
from tests.daemon.health.snapshots import daemon, sink
from tests.waiting import LIMIT_S, wait_for


@pytest.fixture
def configuration(tmp_path):
    ports = free_port(), free_port()
    path = tmp_path / "acqd.toml"
    path.write_text(f"[health]\nport = {ports[0]}\nsink_port = {ports[1]}\n")
    return path, *ports


def child(parent, word):
    """Pid of the child process whose command line holds the word."""
    pids = Path(f"/proc/{parent}/task/{parent}/children").read_text().split()
    return next(int(pid) for pid in pids if word in Path(f"/proc/{pid}/cmdline").read_bytes())


def serve(port, snapshot):
    server = HealthServer("127.0.0.1", port, lambda: snapshot)
    server.start()
    return server


def test_services_that_work_are_shown_with_exit_0(configuration):
    path, port, sink_port = configuration
    servers = [serve(port, daemon()), serve(sink_port, sink())]
    done = acqd_here("status", "--config", path)
    assert done.returncode == 0 and "cell1" in done.stdout and "8 without receipt" in done.stdout
    done = acqd_here("status", "--config", path, "--json")
    told = json.loads(done.stdout)
    assert told["healthy"] and [one["service"] for one in told["services"]] == ["daemon", "sink"]
    for server in servers:
        server.stop()


def test_a_problem_and_an_absent_service_are_exit_1(configuration):
    path, port, _ = configuration
    server = serve(port, daemon(broker=Link(False, trouble="bad password")))
    done = acqd_here("status", "--config", path)
    assert done.returncode == 1 and "bad password" in done.stdout and "is the service running" in done.stdout
    assert acqd_here("status", "--config", path, "--only", "daemon").returncode == 1
    server.stop()


def test_a_stranger_on_the_port_is_no_service(configuration):
    path, port, sink_port = configuration
    server = serve(port, sink())
    with socket.create_server(("127.0.0.1", sink_port)) as mute:
        mute.listen()
        done = acqd_here("status", "--config", path)
    assert done.returncode == 1 and "the sink answers" in done.stdout
    server.stop()


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("port = 0\nsink_port = 0", "no endpoints to ask"),
        ('host = "0.0.0.0"', "loopback"),
        ('host = "localhost"', "loopback"),
        ("port = 70000", "health.port"),
    ],
)
def test_bad_input_is_exit_2(text, expected, tmp_path):
    path = tmp_path / "acqd.toml"
    path.write_text(f"[health]\n{text}\n")
    assert expected in refused(acqd_here("status", "--config", path))


@pytest.mark.slow("cli.status", "daemon")
def test_the_real_daemon_and_its_sink_answer_and_a_stopped_main_fast_shows(tmp_path):
    ports = free_port(), free_port(), free_port()
    path = tmp_path / "acqd.toml"
    path.write_text(
        f"[mqtt]\nport = {ports[0]}\n[broker]\nembedded = true\n"
        f'[sink]\nembedded = true\ndatabase = "{tmp_path}/a.sqlite"\n'
        f"[health]\nport = {ports[1]}\nsink_port = {ports[2]}\n"
    )
    service = start("run", "--config", path, cwd=tmp_path)

    def told():
        time.sleep(0.2)  # each question costs more than a look
        return json.loads(acqd_here("status", "--config", path, "--json").stdout)

    try:
        wait_for(lambda: service.poll() is not None or told()["healthy"], "both are ready")
        wait_for(lambda: told()["services"][1]["status"]["rows"], "rows in the database")
        first = told()["services"][0]["status"]
        assert first["rows"] > 0 and first["delivery"]["delivered"] > 0 and first["cycles"]["cycles"] > 0
        assert first["synchronised"] in (True, False, None) and first["source"]["connected"]
        os.kill(child(service.pid, b"acqd.plc.process"), signal.SIGSTOP)
        wait_for(lambda: told()["services"][0]["status"]["cycles"]["restarts"] == 1, "the restart is counted")
        wait_for(lambda: told()["healthy"], "rows again")
        os.kill(child(service.pid, b"--embedded"), signal.SIGKILL)
        wait_for(lambda: not told()["healthy"], "the sink is gone")
        wait_for(lambda: told()["healthy"], "the sink is back, the daemon has not noticed")
    finally:
        service.terminate()
        service.communicate(timeout=LIMIT_S)
    assert service.returncode == 0
