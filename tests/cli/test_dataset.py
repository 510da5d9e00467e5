"""`acqd dataset` as a user runs it."""

import json
import re

from tests.commands import acqd_here
from tests.dataset.logs import write_logs


def test_the_command_builds_shows_and_refuses(campaign, training, logs, tmp_path):
    out = tmp_path / "ds"
    (tmp_path / "logs").mkdir()
    for log in logs[:4]:
        (tmp_path / "logs" / log.name).symlink_to(log)
    common = ("dataset", "build", "--logs", tmp_path / "logs", "--robot", "iiwa7_r800", "--out")
    built = acqd_here(*common, out, "--power", campaign / "power.sqlite", "--json")
    assert built.returncode == 0, built.stderr
    assert json.loads(built.stdout)["recordings"] == 4
    shown = acqd_here("dataset", "show", training)
    assert shown.returncode == 0 and "clock line" in shown.stdout and "simulated" in shown.stdout
    again = acqd_here(*common, out, "--power", campaign / "power.sqlite")
    assert again.returncode == 2 and "exists; choose another --out" in again.stderr
    wrong = acqd_here(*common, tmp_path / "other", "--power", tmp_path / "nothing.sqlite")
    assert wrong.returncode == 2 and "no such file" in wrong.stderr
    none = acqd_here("dataset", "show", tmp_path)
    assert none.returncode == 2 and "is not a dataset" in none.stderr


def test_power_from_the_log_growing_and_exit_codes(tmp_path):
    out, logs = tmp_path / "ds", write_logs(tmp_path / "logs", 3)
    (logs / "bad.csv").write_text("nothing,here\n")
    build = ("dataset", "build", "--power", "log", "--logs", logs, "--out", out)
    done = acqd_here(*build, "--robot", "ur3e")
    assert done.returncode == 0, done.stderr
    assert "(bus): 3 recordings" in done.stdout and "no alignment needed" in done.stdout
    assert "1 logs refused" in done.stdout and "bad.csv: has no rows of numbers" in done.stderr
    assert "the logs were read as those of" not in done.stderr  # --robot was given
    write_logs(logs, 2, first=4)
    grown = acqd_here(*build, "--append", "--json")  # robot and step are those of the dataset
    report = json.loads(grown.stdout)
    assert (report["recordings"], report["known"], report["version"]) == (2, 3, 2)
    for arguments, complaint in (
        ((*build, "--append"), "nothing new, 5 of its logs .*; 1 cannot be used, the first: "),
        ((*build[:-1], tmp_path / "two", "--cut", "soon"), "--cut soon: expected auto, 0, or at least 2.5 s"),
        ((*build[:-1], tmp_path / "two", "--robot", "kinova_gen3"), "none of 6 logs can be used; the first: "),
        (
            (*build[:-1], tmp_path / "two"),
            "; --robot was not given: the logs were read as those of iiwa7_r800",
        ),
        ((*build, "--append", "--robot", "kinova_gen3"), "holds recordings of ur3e, not of kinova_gen3"),
    ):
        failed = acqd_here(*arguments)
        assert failed.returncode == 2 and re.search(complaint, failed.stderr), failed.stderr
        assert len(failed.stderr.strip().splitlines()) == 1
    assert not (tmp_path / "two").exists()
