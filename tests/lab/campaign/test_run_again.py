"""Campaigns that were stopped, finished or started twice."""

import fcntl
import shutil
import sqlite3

import pytest

from acqd.errors import UserError
from acqd.lab.campaign.run import run_campaign
from tests.campaigns import campaign_config, measure, quiet, rows_of
from tests.commands import acqd_here


@pytest.fixture
def copied(campaign, campaign_settings, tmp_path):
    """A finished campaign that a test may write into."""
    made, report = campaign
    shutil.copytree(made.out.parent, tmp_path / "copy")
    return campaign_config(tmp_path / "copy", **campaign_settings), report


def test_a_finished_campaign_is_not_run_again(copied):
    config, report = copied
    again = measure(config)
    assert again.rows == 0 and again.sessions_done_before == 3
    assert again.spaces == report.spaces


@pytest.mark.slow
def test_two_processes_make_the_same_campaign_as_one(campaign, campaign_settings, tmp_path):
    config, _ = campaign
    other = campaign_config(tmp_path, jobs=2, **campaign_settings)
    run_campaign(other, quiet)
    assert [tuple(row) for row in rows_of(other.out / "power.sqlite")] == [
        tuple(row) for row in rows_of(config.out / "power.sqlite")
    ]
    for log in config.out.glob("logs/*/*"):
        assert (other.out / log.relative_to(config.out)).read_bytes() == log.read_bytes()


def test_rows_that_the_database_lost_are_made_again(copied):
    config, _report = copied
    path = config.out / "power.sqlite"
    before = [tuple(row) for row in rows_of(path)]
    boot = rows_of(path)[0]["boot"]
    with sqlite3.connect(path) as database:
        (lost,) = database.execute("SELECT count(*) FROM power WHERE boot = ?", (boot,)).fetchone()
        database.execute("DELETE FROM power WHERE boot = ?", (boot,))
    again = measure(config)
    assert again.sessions_done_before == 2 and again.rows == lost > 0
    assert [tuple(row) for row in rows_of(path)] == before


def test_a_campaign_that_runs_cannot_be_started_again_beside_itself(copied):
    config, _ = copied
    with (config.truth / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        with pytest.raises(UserError, match="another process is running this campaign"):
            run_campaign(config, quiet)


def test_other_settings_do_not_go_into_the_same_folder(copied):
    config, _ = copied
    arguments = ["lab", "campaign", "--out", config.out, "--truth", config.truth, "--limited", "4"]
    refused = acqd_here(*arguments)
    assert refused.returncode == 2 and "holds a campaign with other settings" in refused.stderr
