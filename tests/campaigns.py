"""Small campaigns of the virtual laboratory, their rows and their true clock."""

import json
import sqlite3
from pathlib import Path

import numpy as np

from acqd.dataset.build import BuildConfig, build
from acqd.lab.campaign.run import CampaignConfig, run_campaign
from acqd.lab.settings import CampaignSettings
from tests.commands import without_workers


def campaign_config(folder: Path, jobs=1, **settings):
    """What `run_campaign` needs for a campaign in `folder`: campaign/, truth/, campaign/power.sqlite."""
    out = folder / "campaign"
    return CampaignConfig(CampaignSettings(**settings), out, folder / "truth", f"sqlite:///{out}/power.sqlite", jobs)


def quiet(what, share):
    assert 0 <= share <= 1


def measure(config: CampaignConfig):
    """Run the campaign in this process."""
    with without_workers():
        return run_campaign(config, quiet)


def rows_of(path):
    with sqlite3.connect(path) as database:
        database.row_factory = sqlite3.Row
        return database.execute("SELECT * FROM power ORDER BY boot, seq").fetchall()


def true_lags(settings, truth):
    """Controller minus power clock at the middle of every recording."""
    lags = {}
    for session in json.loads((truth / "truth.json").read_text())["sessions"]:
        with np.load(truth / f"{session['session']}.npz") as arrays:
            begin = (int(arrays["start_utc_ns"]) - settings.start_utc_ns) * 1e-9
        for recording in session["recordings"]:
            middle = begin + recording["start_s"] + recording["seconds"] / 2
            lags[recording["name"]] = settings.clock.offset_s + settings.clock.drift_ppm * 1e-6 * middle
    return lags


def build_dataset(campaign, folder, **options):
    """The dataset of a campaign that `campaign_config` described."""
    robot = campaign.settings.robot
    return build(
        BuildConfig(str(campaign.out / "power.sqlite"), campaign.out / "logs", folder, robot, **options), quiet
    )


def write_power(path, time_ns, P):
    """Power rows in a CSV file."""
    rows = [f"{t / 1e9:.6f},{p:.5f}" for t, p in zip(time_ns, P, strict=True)]
    path.write_text("\n".join(["time,P", *rows, ""]))
    return str(path)


CLOCKED = {
    "iiwa7_r800": {"clock": {"offset_s": 30.0, "drift_ppm": 50.0}, "seed": 11},
    "ur10e": {"clock": {"offset_s": -29.0, "drift_ppm": -50.0}, "seed": 12, "mains": {"shape": "rectifier"}},
    "kinova_gen3": {"clock": {"offset_s": 7.3, "drift_ppm": 20.0}, "seed": 13},
}


def clocked(robot, once):
    """A campaign whose clock is off: 4 recordings in limited space, 4 in all space; to look at."""
    settings = {"robot": robot, "session": 4, "recorder": {"missing": 0.05}, "limited": 4, "all_space": 4}
    settings |= CLOCKED[robot]
    folder, _ = once(f"clocked-{robot}", lambda folder: measure(campaign_config(folder, **settings)))
    return campaign_config(folder, **settings)


def clocked_dataset(made, once):
    """The dataset of that campaign with every default, and the report of its making."""
    folder, report = once(f"clocked-{made.settings.robot}-dataset", lambda folder: build_dataset(made, folder / "ds"))
    return folder / "ds", report
