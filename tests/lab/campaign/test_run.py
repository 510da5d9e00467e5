"""A campaign: rows in SQL, logs on another clock, the truth apart."""

import json
import re

import numpy as np
import pytest

from acqd.lab.campaign.run import CampaignConfig
from acqd.lab.settings import CampaignSettings
from acqd.robot import load_description
from acqd.robot.arm import Arm
from acqd.robot.dynamics import inverse_dynamics
from acqd.robot.log_reader import read_log
from tests.campaigns import measure, rows_of


def test_every_window_of_every_stream_is_in_the_database(campaign):
    config, report = campaign
    rows = rows_of(config.out / "power.sqlite")
    assert len(rows) == report.rows == pytest.approx(report.streamed_s / 0.04, abs=6)
    for boot in {row["boot"] for row in rows}:
        numbers = [row["seq"] for row in rows if row["boot"] == boot]
        assert numbers == list(range(len(numbers)))
    assert all("simulated" in json.loads(row["flags"]) for row in rows)
    assert {row["channel"] for row in rows} == {"L1"}


def test_the_public_part_tells_of_no_undeclared_effect_clock_or_seed(campaign):
    config, _ = campaign
    for path in config.out.rglob("*"):
        if path.is_file() and path.suffix in (".json", ".html", ".csv", ".log"):
            text = re.sub('data:image/png;base64,[^"]*', "", path.read_text())
            assert "payload" not in text and "seed" not in text and "ppm" not in text, path
    manifest = json.loads((config.out / "campaign.json").read_text())
    assert manifest["simulated"] is True
    assert [effect["id"] for effect in manifest["effects"]] == ["offset_shift"]
    assert len(manifest["recordings"]) == 5
    truth = json.loads((config.truth / "truth.json").read_text())
    assert {effect["id"] for effect in truth["effects"]} == {"payload", "offset_shift"}


def test_the_truth_accounts_for_energy_and_hidden_power(campaign):
    config, report = campaign
    truth = json.loads((config.truth / "truth.json").read_text())
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
    config, _ = campaign
    truth = json.loads((config.truth / "truth.json").read_text())
    robot = load_description("iiwa7_r800")
    rows = rows_of(config.out / "power.sqlite")
    powers = {}
    for row in rows:
        powers.setdefault(row["boot"], []).append((row["filetime"] / 1e7 - 11_644_473_600, row["P"]))
    begin = config.settings.start_utc_ns * 1e-9
    for session in truth["sessions"]:
        with np.load(config.truth / f"{session['session']}.npz") as arrays:
            start = float(arrays["start_utc_ns"]) * 1e-9
        for recording in session["recordings"]:
            log = read_log(next(config.out.glob(f"logs/*/{recording['name']}.log")), robot)
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
    config, _ = campaign
    robot = load_description("iiwa7_r800")
    log = read_log(next(config.out.glob("logs/*/all_*_0004.log")), robot)
    still = np.abs(np.gradient(log.q, axis=0)).max(axis=1) < 1e-5
    zero = np.zeros_like(log.q[still])
    described = inverse_dynamics(Arm(robot), log.q[still], zero, zero)
    # the true robot deviates from its description, and carries 3 kg that nobody knows of
    error = np.abs(described - log.tau[still])
    assert 0.2 < error.max() < 40


@pytest.mark.long(seconds=8)
def test_campaigns_share_a_database_without_mixing(tmp_path):
    database = f"sqlite:///{tmp_path}/both.sqlite"
    total = 0
    for seed in (1, 2):
        settings = CampaignSettings(limited=1, all_space=0, seed=seed)
        one = CampaignConfig(settings, tmp_path / f"c{seed}", tmp_path / f"t{seed}", database, 1)
        total += measure(one).rows
    assert len(rows_of(tmp_path / "both.sqlite")) == total
