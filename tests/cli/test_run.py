"""`acqd run` as a user runs it."""

from __future__ import annotations

import json
import signal
import sqlite3

import pytest

from acqd.telemetry.broker import free_port
from tests.commands import acqd, start
from tests.waiting import LIMIT_S, wait_for


def test_demonstration_runs_out_of_the_box(tmp_path):
    result = acqd("run", "--duration", "4", "--json", cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    seconds = [json.loads(line) for line in result.stdout.splitlines()]
    assert {s["channel"] for s in seconds} == {"L1", "L2", "L3", "total"}
    assert all("simulated" in s["flags"] and abs(s["Vrms"] - 230) < 1 for s in seconds)
    with sqlite3.connect(tmp_path / "acqd.sqlite") as database:
        rows = database.execute("SELECT seq, flags FROM power WHERE channel='L1' ORDER BY seq").fetchall()
    numbers = [seq for seq, _ in rows]
    skipped = [k for k, (seq, _) in enumerate(rows) if seq != numbers[0] + k]
    assert numbers and numbers == sorted(set(numbers))
    assert not skipped or "gap" in rows[skipped[0]][1]  # only a busy machine loses samples, and it says so


def test_sigterm_finishes_the_window_and_exits_0(tmp_path, mosquitto):
    config = tmp_path / "acqd.toml"
    config.write_text(f'device = "cell1"\nstate_dir = "{tmp_path}"\n[mqtt]\nport = {mosquitto.port}\n')
    watcher = start("watch", "--json", "--port", mosquitto.port, "--count", "100", cwd=tmp_path)
    daemon = start("run", "--config", config, cwd=tmp_path)
    out, _ = watcher.communicate(timeout=LIMIT_S)
    rows = [json.loads(line) for line in out.splitlines()]
    assert len(rows) == 100 and {row["device"] for row in rows} == {"cell1"}
    daemon.send_signal(signal.SIGTERM)
    _, err = daemon.communicate(timeout=LIMIT_S)
    assert daemon.returncode == 0 and "killed" not in err, err
    register = json.loads((tmp_path / "energy-cell1.json").read_text())
    assert len(register["phases"]) == 3 and register["phases"][0]["import_kWh"] > 0
    # W goes on where it was.
    again = start("run", "--config", config, "--json", cwd=tmp_path)
    first = json.loads(again.stdout.readline())
    again.terminate()
    again.communicate(timeout=LIMIT_S)
    assert first["W"] > register["phases"][0]["import_kWh"]


@pytest.mark.slow("daemon")
def test_power_quality_reaches_the_database(tmp_path):
    database = tmp_path / "q.sqlite"
    (tmp_path / "acqd.toml").write_text(
        f"[mqtt]\nport = {free_port()}\n[broker]\nembedded = true\n[sink]\nembedded = true\n"
        f'database = "{database}"\n[quality]\nenabled = true\n[health]\nport = 0\nsink_port = 0\n'
    )
    daemon = start("run", "--config", "acqd.toml", "--json", cwd=tmp_path)
    try:
        wait_for(lambda: daemon.poll() is not None or len(_quality(database)) >= 8, "rows of power quality")
    finally:
        daemon.send_signal(signal.SIGTERM)
        _, err = daemon.communicate(timeout=LIMIT_S)
    assert daemon.returncode == 0, err
    rows = [row for row in _quality(database) if row["aggregation"] == "10/12"]
    assert {row["channel"] for row in rows} == {"L1", "L2", "L3", "total"}
    for row in rows:
        assert "simulated" in json.loads(row["flags"])
        if row["channel"] == "L1" and not {"gap", "transient"} & set(json.loads(row["flags"])):
            assert abs(row["V1"] - 230) < 1 and abs(json.loads(row["V_h"])[4] - 0.02 * 230) < 0.1


def _quality(database):
    with sqlite3.connect(database) as connection:
        connection.row_factory = sqlite3.Row
        if not connection.execute("SELECT 1 FROM sqlite_master WHERE name = 'power_quality'").fetchall():
            return []  # the sink has yet to make it
        return connection.execute("SELECT * FROM power_quality").fetchall()
