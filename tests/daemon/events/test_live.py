"""`acqd run` with events: from the simulated dip to SQL and to the file, and a snapshot through the health port."""

from __future__ import annotations

import json
import sqlite3
import subprocess

import pytest

from acqd.sources import load_waveform
from acqd.telemetry.broker import free_port
from tests.commands import ACQD, acqd_here, refused
from tests.waiting import LIMIT_S, wait_for

CONFIG = """
device = "box"
state_dir = "{folder}"
[source]
kind = "simulated"
sags = [{{ at = 1.0, duration = 0.2, depth = 0.4 }}]
[events]
enabled = true
declared_voltage = 230.0
[mqtt]
port = {broker}
[broker]
embedded = true
[sink]
embedded = true
database = "{folder}/x.sqlite"
[health]
port = {health}
sink_port = 0
"""


@pytest.mark.slow
def test_a_dip_of_the_running_daemon_reaches_sql_and_disk_and_samples_can_be_asked_for(tmp_path):
    config = tmp_path / "acqd.toml"
    config.write_text(CONFIG.format(folder=tmp_path, broker=free_port(), health=free_port()))
    with (tmp_path / "log").open("wb") as log:
        daemon = subprocess.Popen([*ACQD, "run", "--config", str(config)], stdout=subprocess.DEVNULL, stderr=log)
    try:
        wait_for(lambda: daemon.poll() is not None or stored(tmp_path), "the event in SQL")
        (event,) = stored(tmp_path)
        done = acqd_here("capture", "--config", config, "--seconds", "0.5", "--out", tmp_path / "now.cff", "--json")
        assert done.returncode == 0, done.stderr
        other = acqd_here("capture", "--config", config, "--device", "x", "--out", tmp_path / "no.npz")
        assert "no samples of x" in refused(other)
    finally:
        daemon.terminate()
        daemon.wait(LIMIT_S)
    assert (event["device"], event["kind"]) == ("box", "dip") and "simulated" in json.loads(event["flags"])
    assert 0 < event["extreme"] < 0.9 * 230 and event["reference"] == 230
    assert load_waveform(tmp_path / "events-box" / event["waveform"]).simulated
    now = load_waveform(tmp_path / "now.cff")
    assert now.simulated and len(now.codes) == json.loads(done.stdout)["samples"] > 0


def stored(folder):
    """Events that have ended, once the sink has made the table."""
    with sqlite3.connect(folder / "x.sqlite") as connection:
        connection.row_factory = sqlite3.Row
        if not connection.execute("SELECT 1 FROM sqlite_master WHERE name = 'power_event'").fetchall():
            return []
        return list(connection.execute("SELECT * FROM power_event WHERE duration IS NOT NULL"))
