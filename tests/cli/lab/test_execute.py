"""`acqd lab execute` as a user runs it."""

import json

import numpy as np
import paho.mqtt.client as mqtt
import pytest

from acqd.telemetry.broker import free_port
from tests.commands import acqd, acqd_here, start
from tests.places import ROBOT_LOGS, needs_robot_logs
from tests.waiting import wait_for


@needs_robot_logs
@pytest.mark.parametrize(
    ("robot", "log"),
    [
        ("ur3e", "ur3e_rtde/ur3e_rtde_25s.csv"),
        ("ur10e", "ur10e/ur-20_02_05-20sec_8harm.csv"),
        ("kinova_gen3", "kinova_gen3/joint_2_trapez.csv"),
    ],
)
def test_a_real_robots_motion_runs_on_its_virtual_twin(tmp_path, robot, log):
    done = acqd_here("lab", "execute", ROBOT_LOGS / log, "--robot", robot, "--out", tmp_path / "run", "--json")
    assert done.returncode == 0, done.stderr
    report = json.loads(done.stdout)
    assert report["energy_unaccounted"] < 1e-5  # measured motions begin and end anywhere
    assert 20 < report["P_mean_W"] < 400 and report["P_max_W"] > report["P_mean_W"] + 1


def test_execute_writes_rows_log_truth_and_report_and_replay_reads_its_waveform(tmp_path):
    (tmp_path / "t.csv").write_text("0,0,0,0,0,0,0\n20,10,10,-10,10,10,10\n")
    done = acqd_here("lab", "execute", "t.csv", "--out", "run", "--waveform", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    report = json.loads(done.stdout)
    assert report["simulated"] is True and report["energy_unaccounted"] < 1e-6
    assert all((tmp_path / path).is_file() for path in report["files"])
    page = (tmp_path / "run" / "report.html").read_text()
    assert "simulated data" in page and '<svg role="img"' in page and "http" not in page
    replayed = acqd_here("replay", "run/waveform.npz", "--out", "rows.jsonl", cwd=tmp_path)
    assert replayed.returncode == 0, replayed.stderr
    ours = [json.loads(line) for line in (tmp_path / "run" / "rows.jsonl").read_text().splitlines()]
    theirs = [json.loads(line) for line in (tmp_path / "rows.jsonl").read_text().splitlines()]
    assert [row["time"] for row in ours] == [row["time"] for row in theirs]
    np.testing.assert_allclose([r["P"] for r in ours], [r["P"] for r in theirs], rtol=1e-3)
    assert all("simulated" in row["flags"] for row in theirs)


def test_a_recorded_motion_is_played_again(tmp_path):
    (tmp_path / "t.csv").write_text("0,0,0,0,0,0,0\n40,20,10,-30,10,20,10\n-10,20,0,-30,0,0,0\n")
    first = acqd_here("lab", "execute", "t.csv", "--out", "one", "--json", cwd=tmp_path)
    again = acqd_here("lab", "execute", "one/t.log", "--out", "two", "--json", cwd=tmp_path)
    assert again.returncode == 0, again.stderr
    means = [json.loads(done.stdout)["P_mean_W"] for done in (first, again)]
    assert means[0] == pytest.approx(means[1], rel=0.01)


@pytest.mark.slow("cli.lab.execute")
def test_live_execution_reaches_a_subscriber(tmp_path):
    port = free_port()
    (tmp_path / "t.csv").write_text("0,0,0,0,0,0,0\n15,10,10,-10,10,10,10\n")
    (tmp_path / "acqd.toml").write_text(f'device = "robot"\n[mqtt]\nport = {port}\n[realtime]\npriority = 0\n')
    broker = start("broker", "--port", port, "--json")
    assert json.loads(broker.stdout.readline())["port"] == port
    rows, subscribed = [], []
    client = mqtt.Client(mqtt.CallbackAPIVersion.VERSION2)
    client.on_message = lambda _, __, message: rows.append(json.loads(message.payload))
    client.on_subscribe = lambda *_: subscribed.append(True)
    client.connect("127.0.0.1", port)
    client.subscribe("acqd/robot/L1/power", qos=1)
    client.loop_start()
    wait_for(lambda: subscribed, "the subscription")
    done = acqd("lab", "execute", "t.csv", "--live", "--config", "acqd.toml", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert '"simulated"' in done.stdout
    wait_for(lambda: np.ptp([row["P"] for row in rows] or [0.0]) > 10, "rows at rest and in motion")
    client.loop_stop()
    broker.terminate()
    broker.communicate()
    assert all("simulated" in row["flags"] for row in rows)
