"""`acqd dataset` as a user runs it."""

import json

from tests.commands import acqd_here


def test_the_command_builds_shows_and_refuses(study, logs, tmp_path):
    campaign, out = study.out / "training", tmp_path / "ds"
    (tmp_path / "logs").mkdir()
    for log in logs[:4]:
        (tmp_path / "logs" / log.name).symlink_to(log)
    common = ("dataset", "build", "--logs", tmp_path / "logs", "--robot", "iiwa7_r800", "--out")
    built = acqd_here(*common, out, "--power", campaign / "power.sqlite", "--json")
    assert built.returncode == 0, built.stderr
    assert json.loads(built.stdout)["recordings"] == 4
    shown = acqd_here("dataset", "show", study.training)
    assert shown.returncode == 0 and "clock line" in shown.stdout and "simulated" in shown.stdout
    again = acqd_here(*common, out, "--power", campaign / "power.sqlite")
    assert again.returncode == 2 and "exists; choose another --out" in again.stderr
    wrong = acqd_here(*common, tmp_path / "other", "--power", tmp_path / "nothing.sqlite")
    assert wrong.returncode == 2 and "does not exist" in wrong.stderr
    none = acqd_here("dataset", "show", tmp_path)
    assert none.returncode == 2 and "is not a dataset" in none.stderr
