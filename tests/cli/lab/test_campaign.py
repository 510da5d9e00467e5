"""`acqd lab campaign` as a user runs it: killed, resumed, on Ray."""

import json
import subprocess
import sys

import numpy as np
import psutil
import pytest

from acqd.robot import load_description
from acqd.robot.arm import Arm
from acqd.robot.log_reader import read_log
from tests.campaigns import rows_of
from tests.commands import acqd, acqd_here, without_workers
from tests.waiting import wait_for


def workers_of(parent):
    children = psutil.Process(parent.pid).children(recursive=True)
    return [child for child in children if "spawn_main" in str(child.cmdline())]


@pytest.mark.slow("lab.campaign")
def test_workers_end_with_a_killed_campaign_and_it_goes_on_where_it_was(tmp_path):
    arguments = ["lab", "campaign", "--out", tmp_path / "c", "--limited", "2", "--all", "1", "--session", "1"]
    parent = subprocess.Popen([sys.executable, "-P", "-m", "acqd", *map(str, [*arguments, "--jobs", "2"])])
    wait_for(lambda: len(workers_of(parent)) == 2, "two workers")
    workers, finished = workers_of(parent), tmp_path / "c.truth" / "work"
    wait_for(lambda: len(list(finished.glob("*.json"))) >= 1, "a session is done")
    parent.kill()
    parent.wait()
    wait_for(lambda: not any(w.is_running() and w.status() != "zombie" for w in workers), "the workers' end")
    with without_workers():
        again = acqd_here(*arguments, "--json")
    assert again.returncode == 0, again.stderr
    report = json.loads(again.stdout)
    assert report["sessions_done_before"] >= 1 and report["recordings"] == 3
    rows = rows_of(tmp_path / "c" / "power.sqlite")
    assert len(rows) == pytest.approx(report["streamed_s"] / 0.04, abs=7)
    assert len(list((tmp_path / "c" / "logs").rglob("*.log"))) == 3


@pytest.mark.minutes
def test_a_fleet_on_a_real_ray_cluster(tmp_path):
    pytest.importorskip("ray", reason="needs acqd[ray]")
    out = tmp_path / "fleet"
    arguments = ["--limited", "1", "--all", "0", "--cells", "2", "--engine", "ray", "--json"]
    done = acqd("lab", "campaign", "--out", out, *arguments)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["recordings"] == 2
    rows = rows_of(out / "power.sqlite")
    by_device = {row["device"]: [] for row in rows}
    for row in rows:
        by_device[row["device"]].append(row["P"])
    assert sorted(by_device) == ["cell-01", "cell-02"]
    assert max(by_device["cell-01"]) != max(by_device["cell-02"])


@pytest.mark.slow("lab")
def test_the_use_case_has_a_twin_that_moves_differently_but_arrives_alike(study):
    campaign = study.assembly  # by acqd lab campaign --profile use-case
    truth = json.loads(campaign.with_name("assembly.truth").joinpath("truth.json").read_text())
    assert {effect["id"] for effect in truth["effects"]} == {"brake_release", "payload"}
    assert json.loads((campaign / "campaign.json").read_text())["effects"] == []
    robot = load_description("iiwa7_r800")
    real = read_log(next((campaign / "logs").rglob("*_0001.log")), robot)
    twin = read_log(next((campaign / "twin").rglob("*_0001.csv")), robot)
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
