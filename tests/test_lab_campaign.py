"""Campaigns end to end: rows in SQL, logs on another clock, the truth apart; resumed, in parallel, on Ray."""

import fcntl
import itertools
import json
import os
import pickle
import re
import signal
import sqlite3
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import psutil
import pytest

from acqd.cli.lab.options import settings_from
from acqd.errors import InputError, UserError
from acqd.lab.campaign.run import CampaignConfig, run_campaign
from acqd.lab.campaign.run_session import steady_error
from acqd.lab.effects import parse_effect
from acqd.lab.schedule import plan_sessions
from acqd.lab.settings import CampaignSettings, LabSettings
from acqd.robot import load_description
from acqd.robot.arm import Arm
from acqd.robot.description import read_toml_table
from acqd.robot.dynamics import inverse_dynamics
from acqd.robot.log import read_log
from tests.conftest import wait_for

SMALL = {"limited": 3, "all_space": 2, "session": 2, "limited_sources": 2, "all_space_sources": 2}


def order(folder: Path, jobs=1, **settings):
    out = folder / "campaign"
    database = f"sqlite:///{out}/power.sqlite"
    return CampaignConfig(CampaignSettings(**{**SMALL, **settings}), out, folder / "truth", database, jobs)


def quiet(what, share):
    assert 0 <= share <= 1


def rows_of(path):
    with sqlite3.connect(path) as database:
        database.row_factory = sqlite3.Row
        return database.execute("SELECT * FROM power ORDER BY boot, seq").fetchall()


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    folder = tmp_path_factory.mktemp("lab")
    hidden = parse_effect("payload:mass_kg=3,from=4", declared=False)
    told = parse_effect("offset_shift:power_W=2")
    the_order = order(folder, effects=[hidden, told], clock={"offset_s": -7.0, "drift_ppm": 50.0})
    return the_order, run_campaign(the_order, quiet)


def test_every_window_of_every_stream_is_in_the_database(campaign):
    the_order, report = campaign
    rows = rows_of(the_order.out / "power.sqlite")
    assert len(rows) == report.rows == pytest.approx(report.streamed_s / 0.04, abs=6)
    for boot in {row["boot"] for row in rows}:
        numbers = [row["seq"] for row in rows if row["boot"] == boot]
        assert numbers == list(range(len(numbers)))
    assert all("simulated" in json.loads(row["flags"]) for row in rows)
    assert {row["channel"] for row in rows} == {"L1"}


def test_the_public_part_tells_of_no_undeclared_effect_clock_or_seed(campaign):
    the_order, _ = campaign
    for path in the_order.out.rglob("*"):
        if path.is_file() and path.suffix in (".json", ".html", ".csv", ".log"):
            text = re.sub('data:image/png;base64,[^"]*', "", path.read_text())
            assert "payload" not in text and "seed" not in text and "ppm" not in text, path
    manifest = json.loads((the_order.out / "campaign.json").read_text())
    assert manifest["simulated"] is True
    assert [effect["id"] for effect in manifest["effects"]] == ["offset_shift"]
    assert len(manifest["recordings"]) == 5
    truth = json.loads((the_order.truth / "truth.json").read_text())
    assert {effect["id"] for effect in truth["effects"]} == {"payload", "offset_shift"}


def test_the_truth_accounts_for_energy_and_hidden_power(campaign):
    the_order, report = campaign
    truth = json.loads((the_order.truth / "truth.json").read_text())
    assert report.energy_unaccounted < 1e-6
    hidden = {
        recording["number"]: recording["hidden_W"]["rms"]
        for session in truth["sessions"]
        for recording in session["recordings"]
    }
    assert all(hidden[number] == pytest.approx(2.0, abs=0.01) for number in (1, 2, 3))
    assert min(hidden[4], hidden[5]) > 3.0
    assert report.steady_error["window_rms"] < 1e-3 and report.steady_error["second_worst"] < 1e-3


def test_logs_are_the_motion_on_the_controllers_own_clock(campaign):
    the_order, _ = campaign
    truth = json.loads((the_order.truth / "truth.json").read_text())
    robot = load_description("iiwa7_r800")
    rows = rows_of(the_order.out / "power.sqlite")
    powers = {}
    for row in rows:
        powers.setdefault(row["boot"], []).append((row["filetime"] / 1e7 - 11_644_473_600, row["P"]))
    begin = the_order.settings.start_utc_ns * 1e-9
    for session in truth["sessions"]:
        with np.load(the_order.truth / f"{session['session']}.npz") as arrays:
            start = float(arrays["start_utc_ns"]) * 1e-9
        for recording in session["recordings"]:
            log = read_log(next(the_order.out.glob(f"logs/*/{recording['name']}.log")), robot)
            true_begin = start + recording["start_s"]
            expected = true_begin + (true_begin - begin) * 50e-6 - 7.0
            assert log.time[0] == pytest.approx(expected, abs=5e-3)
            # with the clock set right, electrical power follows mechanical power
            t = (log.time + 7.0 - begin) / (1 + 50e-6) + begin
            qd = np.gradient(log.q, log.time, axis=0)
            mechanical = (log.tau * qd).sum(axis=1)
            stamps, P = np.array(powers[session["boot"]]).T
            electrical = np.interp(t, stamps + 0.02, P)
            assert np.corrcoef(mechanical, electrical)[0, 1] > 0.7


def test_logged_torques_are_those_of_the_rigid_body(campaign):
    the_order, _ = campaign
    robot = load_description("iiwa7_r800")
    log = read_log(next(the_order.out.glob("logs/*/all_*_0004.log")), robot)
    still = np.abs(np.gradient(log.q, axis=0)).max(axis=1) < 1e-5
    zero = np.zeros_like(log.q[still])
    described = inverse_dynamics(Arm(robot), log.q[still], zero, zero)
    # the true robot deviates from its description, and carries 3 kg that nobody knows of
    error = np.abs(described - log.tau[still])
    assert 0.2 < error.max() < 40


def test_a_finished_campaign_is_not_run_again(campaign):
    the_order, report = campaign
    again = run_campaign(the_order, quiet)
    assert again.rows == 0 and again.sessions_done_before == 3
    assert again.spaces == report.spaces


def test_two_processes_make_the_same_campaign_as_one(campaign, tmp_path):
    the_order, _ = campaign
    effects = the_order.settings.effects
    other = order(tmp_path, jobs=2, effects=effects, clock={"offset_s": -7.0, "drift_ppm": 50.0})
    run_campaign(other, quiet)
    assert [tuple(row) for row in rows_of(other.out / "power.sqlite")] == [
        tuple(row) for row in rows_of(the_order.out / "power.sqlite")
    ]
    for log in the_order.out.glob("logs/*/*"):
        assert (other.out / log.relative_to(the_order.out)).read_bytes() == log.read_bytes()


def test_rows_that_the_database_lost_are_made_again(campaign):
    the_order, _report = campaign
    database = the_order.out / "power.sqlite"
    before = [tuple(row) for row in rows_of(database)]
    database.unlink()
    again = run_campaign(the_order, quiet)
    assert again.sessions_done_before == 0 and again.rows == len(before)
    assert [tuple(row) for row in rows_of(database)] == before


def test_campaigns_share_a_database_without_mixing(tmp_path):
    database = f"sqlite:///{tmp_path}/both.sqlite"
    total = 0
    for seed in (1, 2):
        settings = CampaignSettings(limited=1, all_space=0, seed=seed)
        one = CampaignConfig(settings, tmp_path / f"c{seed}", tmp_path / f"t{seed}", database, 1)
        total += run_campaign(one, quiet).rows
    assert len(rows_of(tmp_path / "both.sqlite")) == total


def test_a_campaign_that_runs_cannot_be_started_again_beside_itself(campaign):
    the_order, _ = campaign
    with (the_order.truth / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        with pytest.raises(UserError, match="another process is running this campaign"):
            run_campaign(the_order, quiet)


def test_workers_end_with_a_killed_parent(tmp_path):
    arguments = ["lab", "campaign", "--out", tmp_path / "c", "--limited", "2", "--all", "2", "--session", "1"]
    parent = subprocess.Popen([sys.executable, "-P", "-m", "acqd", *map(str, [*arguments, "--jobs", "2"])])
    wait_for(lambda: len(list((tmp_path / "c").rglob("*.log"))) >= 1, "a log", 60)
    workers = [
        child for child in psutil.Process(parent.pid).children(recursive=True) if "spawn_main" in str(child.cmdline())
    ]
    assert len(workers) == 2
    parent.kill()
    parent.wait()
    wait_for(lambda: not any(w.is_running() and w.status() != "zombie" for w in workers), "the workers' end", 10)


def test_a_worker_tells_bad_input_as_one_line(tmp_path):
    """InputError has a constructor of its own and must survive the way back from another process."""
    error = pickle.loads(pickle.dumps(InputError("x.csv", "row 3 is empty")))
    assert isinstance(error, UserError) and str(error) == "x.csv: row 3 is empty"


def run_acqd(*arguments, **options):
    command = [sys.executable, "-P", "-m", "acqd", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=100, **options)


def test_a_killed_campaign_goes_on_where_it_was(tmp_path):
    arguments = ["lab", "campaign", "--out", tmp_path / "c", "--limited", "2", "--all", "4", "--session", "1"]
    command = [sys.executable, "-P", "-m", "acqd", *map(str, [*arguments, "--jobs", "2"])]
    process = subprocess.Popen(command, start_new_session=True)
    done = tmp_path / "c.truth" / "work"
    wait_for(lambda: len(list(done.glob("*.json"))) >= 2, "two sessions done", 60)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    finished = run_acqd(*arguments, "--json")
    assert finished.returncode == 0, finished.stderr
    report = json.loads(finished.stdout)
    assert report["sessions_done_before"] >= 2 and report["recordings"] == 6
    rows = rows_of(tmp_path / "c" / "power.sqlite")
    assert len(rows) == pytest.approx(report["streamed_s"] / 0.04, abs=7)
    assert len(list((tmp_path / "c" / "logs").rglob("*.log"))) == 6


def test_other_settings_do_not_go_into_the_same_folder(campaign):
    the_order, _ = campaign
    arguments = ["lab", "campaign", "--out", the_order.out, "--truth", the_order.truth, "--limited", "4"]
    refused = run_acqd(*arguments)
    assert refused.returncode == 2 and "holds a campaign with other settings" in refused.stderr
    assert "Traceback" not in refused.stderr


def test_a_fleet_on_a_real_ray_cluster(tmp_path):
    out = tmp_path / "fleet"
    arguments = ["--limited", "1", "--all", "0", "--cells", "2", "--engine", "ray", "--json"]
    done = run_acqd("lab", "campaign", "--out", out, *arguments)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["recordings"] == 2
    rows = rows_of(out / "power.sqlite")
    by_device = {row["device"]: [] for row in rows}
    for row in rows:
        by_device[row["device"]].append(row["P"])
    assert sorted(by_device) == ["cell-01", "cell-02"]
    assert max(by_device["cell-01"]) != max(by_device["cell-02"])


def test_the_use_case_has_a_twin_that_moves_differently_but_arrives_alike(tmp_path):
    done = run_acqd("lab", "campaign", "--out", tmp_path / "u", "--profile", "use-case", "--assemblies", "2", "--json")
    assert done.returncode == 0, done.stderr
    truth = json.loads((tmp_path / "u.truth" / "truth.json").read_text())
    assert {effect["id"] for effect in truth["effects"]} == {"brake_release", "payload"}
    assert json.loads((tmp_path / "u" / "campaign.json").read_text())["effects"] == []
    robot = load_description("iiwa7_r800")
    real = read_log(next((tmp_path / "u" / "logs").rglob("*_0001.log")), robot)
    twin = read_log(next((tmp_path / "u" / "twin").rglob("*_0001.csv")), robot)
    from acqd.robot.kinematics import forward_kinematics

    t = np.arange(0, 30, 0.04)
    mine, theirs = (
        np.column_stack([np.interp(t, log.time - log.time[0], column) for column in log.q.T]) for log in (real, twin)
    )
    apart = np.degrees(np.abs(mine - theirs)).mean(axis=0)
    assert min(apart[2], apart[4]) > 8 and max(apart[1], apart[3]) < 5
    positions = [forward_kinematics(Arm(robot), q)[0] for q in (mine, theirs)]
    assert np.linalg.norm(positions[0] - positions[1], axis=1).mean() < 0.05
    assert real.signals["tool"].max() == 1


def test_sessions_take_turns_with_the_sources_and_never_overlap():
    plans = plan_sessions(CampaignSettings())
    recordings = [recording for plan in plans for recording in plan.recordings]
    assert len(recordings) == 337
    assert [recording.number for recording in recordings] == list(range(1, 338))
    assert {recording.source_name for recording in recordings if recording.space == "all"} == {
        f"all_{number:02d}" for number in range(1, 31)
    }
    for before, after in itertools.pairwise(plans):
        assert after.start_s - before.start_s >= len(before.recordings) * 250


def test_the_steady_error_sees_a_wrong_meter():
    power = 155 + 0.3 * np.random.default_rng(0).standard_normal(1000)
    assert steady_error(power, power * 1.002)["second_worst"] == pytest.approx(0.002)
    assert steady_error(np.linspace(0, 5000, 1000), np.linspace(0, 5000, 1000))["windows"] == 0


def test_the_rest_of_acqd_starts_without_the_laboratorys_libraries():
    script = (
        "import sys, acqd.cli.main; print([m for m in ('pinocchio', 'scipy', 'matplotlib', 'ray') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-P", "-c", script], capture_output=True, text=True)
    assert done.stdout.strip() == "[]", done.stderr


def test_the_settings_file_that_is_shipped_says_the_defaults(tmp_path):
    path = Path(__file__).parents[1] / "config" / "lab.toml"
    told = CampaignSettings(**read_toml_table(path))
    assert told == CampaignSettings()
    commented = re.sub(
        r"^# (profile|limited|all_space|\w+_sources|assemblies|session|cells) =", r"\1 =", path.read_text(), flags=re.M
    )
    (tmp_path / "lab.toml").write_text(commented)
    assert CampaignSettings(**read_toml_table(tmp_path / "lab.toml")) == CampaignSettings()
    assert settings_from(LabSettings, tmp_path / "lab.toml", {}, []) == LabSettings()


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["trajectories", "--out", "x", "--cube", "2", "0", "0.5", "0.2"], "cube at 2 0 0.5 m"),
        (["trajectories", "--out", "x", "--robot", "r2d2"], "robot 'r2d2' is unknown"),
        (["trajectories", "--out", "x", "--scene", "nowhere"], "scene 'nowhere' is unknown; known: digital_factory"),
        (["trajectories", "--out", "x", "--scene", "crate.toml"], "box 'crate'"),
        (["execute", "short.csv", "--out", "x"], "short.csv: has 2 columns, but iiwa7_r800 has 7 axes"),
        (["execute", "back.csv", "--out", "x"], "back.csv: time goes from"),
        (["execute", "missing.csv", "--out", "x"], "missing.csv: cannot be read"),
        (["execute", "good.csv"], "give either --out FOLDER"),
        (["execute", "good.csv", "--out", "x", "--effect", "gremlins"], "effect 'gremlins' is unknown"),
        (["execute", "good.csv", "--out", "x", "--settings", "lab.toml"], "lab.toml: mains.voltage"),
        (["campaign", "--out", "x", "--limited", "0", "--all", "0"], "the campaign has no recordings"),
        (
            ["campaign", "--out", "x", "--limited", "1", "--all", "0", "--effect", "payload:from=9"],
            "campaign ends with 1",
        ),
        (["campaign", "--out", "x", "--effect", "encoder_bias:axis=9"], "the robot has the axes 1 to 7"),
        (["campaign", "--out", "x", "--settings", "typo.toml"], "typo.toml: effects.0: effect 'paylod' is unknown"),
        (["campaign", "--out", "x", "--settings", "odd.toml"], "odd.toml: window: expected whole milliseconds"),
        (["campaign", "--out", "x", "--truth", "x/truth"], "which an analyst may read"),
        (
            ["execute", "good.csv", "--out", "x", "--effect", "payload:at=1000"],
            "effect payload: at=1000, but good lasts only",
        ),
        (["execute", "good.csv", "--out", "x", "--effect", "payload:from=2"], "an execution has only one recording"),
        (["execute", "tiny.csv", "--out", "x"], "tiny.csv: has 30 rows over 0.00029 s"),
        (["trajectories", "--out", "good.csv/deep"], "good.csv/deep: cannot be made"),
        (["campaign", "--out", "full"], "full is not empty"),
        (["campaign", "--out", "x", "--profile", "use-case", "--robot", "ur3e"], "ur3e cannot reach"),
    ],
)
def test_bad_input_is_one_clear_line_and_leaves_nothing(tmp_path, arguments, complaint):
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "thesis.txt").write_text("mine")
    (tmp_path / "short.csv").write_text("1,2\n3,4\n")
    (tmp_path / "good.csv").write_text("0,0,0,0,0,0,0\n10,10,10,10,10,10,10\n")
    header = "time," + ",".join(f"q{k}" for k in range(1, 8))
    (tmp_path / "back.csv").write_text(header + "".join(f"\n{t},0,0,0,0,0,0,0" for t in (0, 1, 0.5, 2, 3, 4, 5, 6, 7)))
    (tmp_path / "lab.toml").write_text("[mains]\nvoltage = 12\n")
    (tmp_path / "tiny.csv").write_text(header + "".join(f"\n{k * 1e-5:.5f},0,0,0,0,0,0,0" for k in range(30)))
    (tmp_path / "typo.toml").write_text('[[effects]]\nid = "paylod"\n')
    (tmp_path / "odd.toml").write_text("window = 0.0425\n")
    crate = '[[box]]\nname = "crate"\ncentre = [0, 0, 1.0]\nsize = [0.6, 0.6, 0.3]\n'
    (tmp_path / "crate.toml").write_text('name = "crate"\n' + crate)
    done = run_acqd("lab", *arguments, cwd=tmp_path)
    assert done.returncode == 2, done.stderr
    assert complaint in done.stderr and len(done.stderr.strip().splitlines()) == 1
    assert not (tmp_path / "x").exists() or not any((tmp_path / "x").iterdir())


DATA = Path(__file__).parents[2] / "shared" / "data" / "robots"


@pytest.mark.skipif(not DATA.is_dir(), reason="../shared/data is not there")
@pytest.mark.parametrize(
    ("robot", "log"),
    [
        ("ur3e", "ur3e_rtde/ur3e_rtde_25s.csv"),
        ("ur10e", "ur10e/ur-20_02_05-20sec_8harm.csv"),
        ("kinova_gen3", "kinova_gen3/joint_2_trapez.csv"),
    ],
)
def test_a_real_robots_motion_runs_on_its_virtual_twin(tmp_path, robot, log):
    done = run_acqd("lab", "execute", DATA / log, "--robot", robot, "--out", tmp_path / "run", "--json")
    assert done.returncode == 0, done.stderr
    report = json.loads(done.stdout)
    assert report["energy_unaccounted"] < 1e-5  # measured motions begin and end anywhere
    assert 20 < report["P_mean_W"] < 400 and report["P_max_W"] > report["P_mean_W"] + 1


def test_execute_writes_rows_log_truth_and_report_and_replay_reads_its_waveform(tmp_path):
    (tmp_path / "t.csv").write_text("0,0,0,0,0,0,0\n20,10,10,-10,10,10,10\n")
    done = run_acqd("lab", "execute", "t.csv", "--out", "run", "--waveform", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    report = json.loads(done.stdout)
    assert report["simulated"] is True and report["energy_unaccounted"] < 1e-6
    assert all((tmp_path / path).is_file() for path in report["files"])
    page = (tmp_path / "run" / "report.html").read_text()
    assert "simulated data" in page and "data:image/png;base64," in page and "http" not in page
    replayed = run_acqd("replay", "run/waveform.npz", "--out", "rows.jsonl", cwd=tmp_path)
    assert replayed.returncode == 0, replayed.stderr
    ours = [json.loads(line) for line in (tmp_path / "run" / "rows.jsonl").read_text().splitlines()]
    theirs = [json.loads(line) for line in (tmp_path / "rows.jsonl").read_text().splitlines()]
    assert [row["time"] for row in ours] == [row["time"] for row in theirs]
    np.testing.assert_allclose([r["P"] for r in ours], [r["P"] for r in theirs], rtol=1e-3)
    assert all("simulated" in row["flags"] for row in theirs)


def test_a_recorded_motion_is_played_again(tmp_path):
    (tmp_path / "t.csv").write_text("0,0,0,0,0,0,0\n40,20,10,-30,10,20,10\n-10,20,0,-30,0,0,0\n")
    first = run_acqd("lab", "execute", "t.csv", "--out", "one", "--json", cwd=tmp_path)
    again = run_acqd("lab", "execute", "one/t.log", "--out", "two", "--json", cwd=tmp_path)
    assert again.returncode == 0, again.stderr
    means = [json.loads(done.stdout)["P_mean_W"] for done in (first, again)]
    assert means[0] == pytest.approx(means[1], rel=0.01)


def test_live_execution_reaches_a_subscriber(tmp_path):
    from acqd.telemetry.broker import free_port

    port = free_port()
    (tmp_path / "t.csv").write_text("0,0,0,0,0,0,0\n15,10,10,-10,10,10,10\n")
    (tmp_path / "acqd.toml").write_text(
        f'device = "robot"\n[mqtt]\nport = {port}\n[broker]\nembedded = true\n[realtime]\npriority = 0\n'
    )
    command = [sys.executable, "-P", "-m", "acqd", "lab", "execute", "t.csv", "--live", "--config", "acqd.toml"]
    daemon = subprocess.Popen([*command, "--json"], cwd=tmp_path, stdout=subprocess.PIPE, text=True)
    import paho.mqtt.client as mqtt

    rows = []
    client = mqtt.Client(mqtt.CallbackAPIVersion.VERSION2)
    client.on_message = lambda _, __, message: rows.append(json.loads(message.payload))
    deadline = time.monotonic() + 30
    while time.monotonic() < deadline:
        try:
            client.connect("127.0.0.1", port)
            break
        except OSError:
            time.sleep(0.05)
    client.subscribe("acqd/robot/L1/power", qos=1)
    client.loop_start()
    output, _ = daemon.communicate(timeout=60)
    client.loop_stop()
    assert daemon.returncode == 0
    assert len(rows) > 50 and all("simulated" in row["flags"] for row in rows)
    assert max(row["P"] for row in rows) - min(row["P"] for row in rows) > 10
    assert '"simulated"' in output
