"""`acqd dataset` as a user runs it."""

import json

from tests.commands import acqd, acqd_here


def test_the_command_builds_shows_and_refuses(study, tmp_path):
    campaign, out = study.out / "training", tmp_path / "ds"
    session = min((campaign / "logs").iterdir())
    common = ("dataset", "build", "--logs", session, "--robot", "iiwa7_r800", "--out")
    built = acqd(*common, out, "--power", campaign / "power.sqlite", "--json")
    assert built.returncode == 0, built.stderr
    assert json.loads(built.stdout)["recordings"] == len(list(session.iterdir()))
    shown = acqd_here("dataset", "show", study.training)
    assert shown.returncode == 0 and "clock line" in shown.stdout and "simulated" in shown.stdout
    again = acqd_here(*common, out, "--power", campaign / "power.sqlite")
    assert again.returncode == 2 and "exists; choose another --out" in again.stderr
    wrong = acqd_here(*common, tmp_path / "other", "--power", tmp_path / "nothing.sqlite")
    assert wrong.returncode == 2 and "does not exist" in wrong.stderr
    none = acqd_here("dataset", "show", tmp_path)
    assert none.returncode == 2 and "is not a dataset" in none.stderr
