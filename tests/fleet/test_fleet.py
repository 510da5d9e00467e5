"""`acqd fleet` on three robots and a broken one, as a user runs it."""

import json
import shutil

import pytest

from acqd.fleet.config import read_fleet
from acqd.fleet.run import FleetConfig, run_fleet
from acqd.fleet.scan import Finding, clusters
from acqd.fleet.screen import screen
from acqd.models.bundle.restore import open_model
from tests.browser import chromium, looks, serious_findings
from tests.builders import recording, write_dataset
from tests.commands import acqd_here, refused, without_workers


@pytest.fixture(scope="session")
def plant(closed, model, once):
    """A folder with a fleet's file, its results, and what the command printed."""
    source, _ = closed

    def make(folder):
        for name in ("loaded", "broken"):
            (folder / name).mkdir()
        for part in ("power.csv", "logs"):
            (folder / "loaded" / part).symlink_to(source / "now" / part)
        calm = [recording(model, k, seed=8, rows=900, start_s=1e9 + 9000) for k in range(6)]
        write_dataset(folder / "calm", calm)
        (folder / "plant.toml").write_text(
            "[fleet]\nonly = ['payload', 'offset_shift', 'viscous_friction']\nmax_effects = 1\n"
            f"[defaults]\nmodel = '{source / 'model'}'\npower = '{{name}}/power.csv'\nlogs = '{{name}}/logs'\n"
            "lag_s = 0\n[robots.loaded]\n[robots.broken]\n[robots.calm]\n"
            f"[robots.nobundle]\nmodel = 'nowhere'\ndataset = '{folder / 'calm' / 'ds'}'\n"
        )
        return run(folder).stdout

    return once("plant", make)


def run(folder, *more):
    with without_workers():
        done = acqd_here("fleet", folder / "plant.toml", "--json", *more)
    assert done.returncode == 1, done.stderr  # robots failed
    return done


@pytest.mark.long(seconds=15)
def test_the_changed_robot_is_found_with_its_cause_and_the_broken_ones_are_lines(plant):
    folder, printed = plant
    report = json.loads(printed)
    robots = {robot["name"]: robot for robot in report["robots"]}
    assert {name: robot["state"] for name, robot in robots.items()} == {
        "loaded": "changed", "calm": "unchanged", "broken": "failed", "nobundle": "failed"
    }  # fmt: skip
    assert robots["loaded"]["effects"][0]["id"] == "payload" and robots["loaded"]["q"] < 0.01
    assert robots["calm"]["p"] > 0.05 and robots["calm"]["effects"] == []
    assert "broken/logs" in robots["broken"]["error"] or "broken/power.csv" in robots["broken"]["error"]
    assert "nowhere" in robots["nobundle"]["error"]
    assert report["failed"] == 2 and report["shared"] == []
    stored = json.loads((folder / "plant.fleet" / "report.json").read_text())
    assert stored["robots"] == report["robots"]
    assert (folder / "plant.fleet" / "robots" / "loaded" / "loop" / "report.html").exists()


@pytest.mark.parametrize("shift_s", [-9e6, 9000.0])
def test_recordings_from_before_the_training_have_a_time_in_which_they_were_watched(closed, model, tmp_path, shift_s):
    """Found by hand: two robots asked about older recordings ended the whole fleet with a traceback."""
    folder, _ = closed
    dataset = write_dataset(tmp_path, [recording(model, k, seed=8, rows=900, start_s=1e9 + shift_s) for k in range(6)])
    bundle, opened = open_model(folder / "model")
    screened = screen(folder / "model", bundle, opened, dataset)
    assert screened.trained_s <= screened.first_s < screened.last_s
    assert (screened.trained_s == screened.first_s) == (shift_s < 0)
    findings = [Finding(name, "payload", screened.onset_s, screened.trained_s, screened.last_s) for name in "abc"]
    assert [each.robots for each in clusters(findings, {"payload": 1, "offset_shift": 99}, [3600.0], 0.05, 1)] == [
        ("a", "b", "c")
    ]


@pytest.mark.long(seconds=5)
def test_what_is_done_is_not_done_again(plant, tmp_path):
    folder, _ = plant
    shutil.copytree(folder, tmp_path / "p", symlinks=True)
    kept = tmp_path / "p" / "plant.fleet" / "robots" / "loaded" / "cause.json"
    content = json.loads(kept.read_text())
    content["result"]["verdict"] = "as it was stored"
    kept.write_text(json.dumps(content))
    robots = {robot["name"]: robot for robot in json.loads(run(tmp_path / "p").stdout)["robots"]}
    assert robots["loaded"]["verdict"] == "as it was stored"
    for file in (tmp_path / "p" / "plant.fleet" / "robots").glob("*/screen.json"):
        file.write_text("{")  # as if damaged: screened again, with the same result
    again = {robot["name"]: robot for robot in json.loads(run(tmp_path / "p").stdout)["robots"]}
    assert again == robots


@pytest.mark.long(seconds=3)
def test_new_logs_are_put_into_the_dataset(plant, model, tmp_path):
    from acqd.fleet.dataset import up_to_date

    folder, _ = plant
    (tmp_path / "logs").mkdir()
    logs = sorted((folder / "calm" / "logs").iterdir())
    for log in logs[:4]:
        shutil.copy(log, tmp_path / "logs")
    (tmp_path / "plant.toml").write_text(
        f"[robots.calm]\nmodel = 'm'\npower = '{folder / 'calm' / 'power.csv'}'\nlogs = 'logs'\nlag_s = 0\n"
    )
    (robot,) = read_fleet(tmp_path / "plant.toml").robots

    def recordings():
        current = up_to_date(robot, tmp_path / "calm", "ur10e", 0.04)
        manifest = (current.path / "manifest.json").read_bytes()
        return len(json.loads(manifest)["recordings"]), manifest, current.refused

    first, manifest, _ = recordings()
    assert first == 4 and recordings()[1] == manifest
    shutil.copy(logs[4], tmp_path / "logs")
    (tmp_path / "logs" / "bad.csv").write_text("time,q1\n1,2\n")
    count, manifest, lost = recordings()
    assert count == 5 and len(lost) == 1 and "bad.csv" in lost[0]
    assert recordings() == (count, manifest, lost)


def test_a_folder_with_other_things_is_not_touched(plant, tmp_path):
    folder, _ = plant
    (tmp_path / "mine.txt").write_text("precious")
    with without_workers():
        done = acqd_here("fleet", folder / "plant.toml", "--out", tmp_path)
    assert "holds no fleet's results" in refused(done)
    assert [path.name for path in tmp_path.iterdir()] == ["mine.txt"]


def test_a_second_run_at_the_same_time_is_refused(plant):
    from acqd.errors import UserError
    from acqd.fleet.write import claimed

    folder, _ = plant
    with claimed(folder / "plant.fleet"), pytest.raises(UserError, match="another run"):
        run_fleet(FleetConfig(read_fleet(folder / "plant.toml"), folder / "plant.fleet"), lambda *_: None)


@pytest.mark.browser
def test_the_page_has_no_serious_accessibility_finding_in_any_look(plant):
    folder, _ = plant
    page = folder / "plant.fleet" / "report.html"
    text = page.read_text()
    assert "payload" in text and "http://" not in text.replace("http://www.w3.org", "")
    with chromium() as browser:
        for view in looks(browser):
            view.goto(page.as_uri())
            assert serious_findings(view) == [] and view.errors == []
