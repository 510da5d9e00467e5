"""The way from the robot to the repaired model, as the files in a folder tell it."""

from __future__ import annotations

import importlib.util
import json
from pathlib import Path

import pytest

from acqd.errors import UserError
from acqd.guide.found import found_in
from acqd.guide.page import write_page
from acqd.guide.stages import stages


def write(path: Path, content: object) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps(content))


def dataset(folder: Path, name: str, start: int, count: int = 6) -> None:
    recordings = [{"name": f"r{k}", "valid_s": 60.0} for k in range(count)]
    power = {"first_ns": start * 10**9}
    write(
        folder / name / "manifest.json",
        {"robot": "ur10e", "measured": "simulated", "recordings": recordings, "power": power},
    )


def model(folder: Path, where: str) -> None:
    write(folder / where / "bundle.json", {"name": "grey-box", "robot": "ur10e", "provenance": {"dataset": "ds0"}})


def report(folder: Path, confidence: float, *, verdict: str = "effects_found") -> None:
    effect = {"id": "payload", "where": "flange", "confidence": confidence, "family": {"members": []}, "added": True}
    write(
        folder / "ds1.loop" / "report.json",
        {
            "asked": {"dataset": "ds1", "with": [], "model": "ds0.models/a"}, "verdict": verdict,
            "effects": [effect] if verdict == "effects_found" else [], "correction": None,
            "causes": {"text": "one of these: payload (51 %), gravity_bias (47 %)"},
            "ability": {"effects": [{"id": "payload", "smallest": 0.2}, {"id": "payload", "smallest": 0.3}]},
        },
    )  # fmt: skip
    model(folder, "ds1.loop/model")


def way(folder: Path) -> dict[str, str]:
    """State of every stage."""
    steps = stages(found_in(folder))
    assert sum(step.state == "now" for step in steps) <= 1
    return {step.name: step.state for step in steps}


def now(folder: Path):
    return next(step for step in stages(found_in(folder)) if step.state == "now")


def test_every_step_of_the_work_asks_for_the_next_one(tmp_path):
    assert now(tmp_path).name == "robot" and "acqd robot list" in now(tmp_path).commands
    dataset(tmp_path, "ds0", 100)
    assert now(tmp_path).commands == (f"acqd train {tmp_path}/ds0 --network grey-box",)
    model(tmp_path, "ds0.models/a")
    assert now(tmp_path).name == "can it be told?"
    dataset(tmp_path, "ds1", 200)
    assert now(tmp_path).commands == (f"acqd close-loop {tmp_path}/ds1 --model {tmp_path}/ds0.models/a",)
    report(tmp_path, 0.51)
    assert now(tmp_path).commands == (f"acqd next {tmp_path}/ds1.loop",) and "51 %" in now(tmp_path).says
    write(tmp_path / "ds1.loop.next" / "next.json", {"report": "ds1.loop", "seconds": 176.0, "worked_min": 120.0})
    build, again = now(tmp_path).commands
    assert "2.9 min" in now(tmp_path).says and again.endswith("--with ds2")
    assert build.endswith("--robot ur10e --worked 120 --out ds2")
    report(tmp_path, 0.97)
    assert set(way(tmp_path).values()) == {"done"}


def test_what_a_report_leaves_open_is_the_next_stage(tmp_path):
    dataset(tmp_path, "ds0", 100), model(tmp_path, "ds0.models/a"), dataset(tmp_path, "ds1", 200)
    report(tmp_path, 0.0, verdict="unknown_structure")
    assert now(tmp_path).name == "answer, or the next motion" and way(tmp_path)["repaired model"] == "later"
    report(tmp_path, 0.0, verdict="nothing_left")
    assert "now" not in way(tmp_path).values()


def test_where_no_motion_can_be_designed_the_report_says_what_to_do(tmp_path):
    """Without capsules `acqd next` refuses, and so it does for equipment that no motion of the arm switches."""
    dataset(tmp_path, "ds0", 100), model(tmp_path, "ds0.models/a"), dataset(tmp_path, "ds1", 200)
    report(tmp_path, 0.51)
    file = tmp_path / "ds1.loop" / "report.json"
    told = json.loads(file.read_text())
    write(file, told | {"designable": False, "next": ["to distinguish a from b: weigh the gripper"]})
    step = now(tmp_path)
    assert "weigh the gripper; record that session" in step.says
    build, again = step.commands
    assert build.endswith("--robot ur10e --out ds2") and again.endswith("ds1 --model ds0.models/a --with ds2")


def test_what_is_not_installed_comes_first(tmp_path, monkeypatch):
    dataset(tmp_path, "ds0", 100), model(tmp_path, "ds0.models/a"), dataset(tmp_path, "ds1", 200)
    report(tmp_path, 0.51)
    known = importlib.util.find_spec
    monkeypatch.setattr("acqd.extras.find_spec", lambda name: None if name == "pinocchio" else known(name))
    install, following = now(tmp_path).commands
    assert "install 'acqd[loop,motion]'" in install and following == f"acqd next {tmp_path}/ds1.loop"


def test_a_description_of_the_users_own_and_a_prismatic_axis_have_lines_that_run(tmp_path):
    dataset(tmp_path, "ds0", 100), model(tmp_path, "ds0.models/a"), dataset(tmp_path, "ds1", 200)
    report(tmp_path, 0.97)
    for name in ("ds0", "ds1"):
        manifest = json.loads((tmp_path / name / "manifest.json").read_text())
        write(tmp_path / name / "manifest.json", manifest | {"description": "my robots/mill.toml"})
    bundle = tmp_path / "ds1.loop" / "model" / "bundle.json"
    write(bundle, json.loads(bundle.read_text()) | {"inputs": [{"name": "q1", "unit": "m"}]})
    lines = [line for step in stages(found_in(tmp_path)) for line in step.commands]
    assert "acqd robot check 'my robots/mill.toml'" in lines and not any("export-fmu" in line for line in lines)


def test_short_recordings_are_no_reference(tmp_path):
    dataset(tmp_path, "ds0", 100, count=2)
    assert now(tmp_path).name == "data" and "too little" in now(tmp_path).says


def test_a_repaired_model_is_not_the_one_to_start_from(tmp_path):
    dataset(tmp_path, "ds0", 100), model(tmp_path, "ds0.models/a"), dataset(tmp_path, "ds1", 200)
    report(tmp_path, 0.97)
    dataset(tmp_path, "ds2", 300)
    assert now(tmp_path).commands == (f"acqd close-loop {tmp_path}/ds2 --model {tmp_path}/ds0.models/a",)


def test_recordings_of_another_robot_and_copies_are_not_in_question(tmp_path):
    dataset(tmp_path, "ds0", 100), model(tmp_path, "ds0.models/a")
    dataset(tmp_path, "copy of ds0", 100), dataset(tmp_path, "kuka", 200)
    manifest = json.loads((tmp_path / "kuka" / "manifest.json").read_text())
    write(tmp_path / "kuka" / "manifest.json", manifest | {"robot": "iiwa7_r800"})
    assert now(tmp_path).name == "can it be told?"


def test_simulated_sessions_begin_together_and_are_no_copies(tmp_path):
    dataset(tmp_path, "ds0", 100), model(tmp_path, "ds0.models/a"), dataset(tmp_path, "ds1", 100, count=8)
    assert now(tmp_path).commands == (f"acqd close-loop {tmp_path}/ds1 --model {tmp_path}/ds0.models/a",)


def test_earlier_recordings_without_a_report_are_named(tmp_path):
    dataset(tmp_path, "ds0", 100), model(tmp_path, "ds0.models/a"), dataset(tmp_path, "ds1", 300)
    dataset(tmp_path, "monday/ds1", 200)
    report(tmp_path, 0.97)
    loop = next(step for step in stages(found_in(tmp_path)) if step.name == "loop")
    assert loop.says == f"effects found: payload (flange); no report yet on {tmp_path}/monday/ds1"


def test_a_broken_file_is_named_and_hides_nothing(tmp_path):
    dataset(tmp_path, "ds0", 100)
    (tmp_path / "ds1").mkdir()
    (tmp_path / "ds1" / "manifest.json").write_text("{")
    write(tmp_path / "other" / "report.json", [1])
    (tmp_path / "gone").mkdir()
    (tmp_path / "gone" / "manifest.json").symlink_to(tmp_path / "nowhere")
    model(tmp_path, "ds0.models/b")
    report(tmp_path, 0.9)
    content = json.loads((tmp_path / "ds1.loop" / "report.json").read_text())
    write(tmp_path / "old.loop" / "report.json", content | {"asked": {"with": None}})
    (tmp_path / "ds1.loop" / "report.json").unlink()
    (tmp_path / "ds1.loop" / "model" / "bundle.json").unlink()
    (tmp_path / "ds0.models" / "b" / "bundle.json").unlink()
    found = found_in(tmp_path)
    assert {Path(each).parent.name for each in found.unread} == {"ds1", "other", "gone", "old.loop"}
    assert len(found.datasets) == 1
    write_page(tmp_path / "way.html", found, stages(found))
    page = (tmp_path / "way.html").read_text()
    assert "Next: model" in page and "ds1/manifest.json" in page and "simulated" in page
    with pytest.raises(UserError, match="no such folder"):
        found_in(tmp_path / "absent")
    with pytest.raises(UserError, match="is a file, not a folder"):
        found_in(tmp_path / "way.html")
