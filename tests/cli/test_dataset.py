"""`acqd dataset` as a user runs it."""

from tests.commands import acqd, acqd_here


def test_the_command_builds_and_shows(built):
    folder, said = built
    assert said["recordings"] == 12
    shown = acqd("dataset", "show", folder / "ds")
    assert shown.returncode == 0 and "clock line" in shown.stdout and "simulated" in shown.stdout


def test_the_command_refuses(built, tmp_path):
    folder, _ = built
    common = ("dataset", "build", "--logs", folder / "campaign" / "logs", "--robot", "iiwa7_r800")
    again = acqd_here(*common, "--out", folder / "ds", "--power", folder / "campaign" / "power.sqlite")
    assert again.returncode == 2 and "exists; choose another --out" in again.stderr
    wrong = acqd_here(*common, "--out", tmp_path / "other", "--power", tmp_path / "nothing.sqlite")
    assert wrong.returncode == 2 and "does not exist" in wrong.stderr
    none = acqd_here("dataset", "show", tmp_path)
    assert none.returncode == 2 and "is no dataset" in none.stderr
