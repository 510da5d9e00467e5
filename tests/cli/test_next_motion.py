"""`acqd next` and `acqd close-loop --with` as a user runs them."""

import json
import shutil
from dataclasses import replace

import numpy as np
import pytest

from acqd.discrepancy.thresholds import THRESHOLDS
from acqd.robot import load_description
from acqd.robot.log_reader import read_log
from tests.builders import recording, write_dataset
from tests.commands import acqd_here
from tests.discrepancy.independent import added_payload


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("nowhere",), "acqd close-loop has written"),
        (("{old}",), "run acqd close-loop again"),
        (("{loop}", "--workspace", *"000000"), "two corners"),
        (("{loop}", "--workspace", *"555666"), "lies in the workspace"),
        (("{loop}", "--workspace", *"12345", "nan"), "two corners"),
        (("{loop}", "--cause", "clock_drift"), "another session has other clocks"),
        (("{loop}", "--scene", "nosuch"), "nosuch"),
        (("{loop}", "--out", "{ds}"), "choose another --out"),
        (("{broken}",), "is no report of acqd close-loop"),
        (("{gone}",), "nowhere/ds: no such folder"),
        (("{loop}", "--cause", "nosuch"), "no such effect"),
        (("{loop}", "--minutes", "nan"), "--minutes"),
        (("{loop}", "--limit-speed", "0"), "--limit-speed"),
        (("{loop}", "--scene", "{broken}/report.json"), "report.json"),
    ],
)
def test_bad_input_is_one_line_and_exit_2(closed, tmp_path, arguments, said):
    folder, _ = closed
    (tmp_path / "old").mkdir()
    (tmp_path / "old" / "report.json").write_text(json.dumps({"verdict": "nothing_left", "effects": []}))
    places = {"loop": folder / "now" / "ds.loop", "ds": folder / "now" / "ds", "old": tmp_path / "old"}
    for name, content in (("broken", b"{"), ("gone", _without_dataset(places["loop"]))):
        (tmp_path / name).mkdir()
        (tmp_path / name / "report.json").write_bytes(content)
        places[name] = tmp_path / name
    out = () if "--out" in arguments else ("--out", tmp_path / "next")
    done = acqd_here("next", *(each.format(**places) for each in arguments), *out)
    assert done.returncode == 2
    assert said in done.stderr and len(done.stderr.strip().splitlines()) == 1
    assert not (tmp_path / "next").exists()


def _without_dataset(loop):
    report = json.loads((loop / "report.json").read_bytes())
    return json.dumps(report | {"asked": report["asked"] | {"dataset": "/nowhere/ds"}}).encode()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("robot", "ability", "{model}", "--motion", "nowhere"), "no such file or folder"),
        (("robot", "ability", "{model}", "--motion", "{log}"), "ur10e has 6 axes"),
        (("robot", "ability", "{model}", "--motion", "{empty}"), "is empty"),
        (("robot", "ability", "{ds}"), "is not a bundle"),
        (("guide", "nowhere"), "no such folder"),
        (("guide", "{log}"), "is a file"),
        (("guide", "{model}", "--html", "nowhere/way.html"), "cannot be written"),
        (("close-loop", "{ds}", "--with", "nowhere", "--model", "{model}"), "no such folder"),
        (("close-loop", "{ds}", "--with", "{log}", "--model", "{model}"), "is not a dataset"),
        (("close-loop", "{ds}", "--with", "{ds}", "--model", "{model}"), "in question already"),
        (("dataset", "build", "--power", "p", "--logs", "l", "--out", "o", "--worked", "-1"), "--worked"),
        (("dataset", "build", "--power", "p", "--logs", "l", "--out", "o", "--worked", "nan"), "--worked"),
        (("lab", "execute", "{log}", "--out", "o", "--worked", "-1"), "--worked"),
        (("lab", "investigate", "--out", "o"), "name the change to hide"),
    ],
)
def test_every_stage_of_the_way_refuses_bad_input_in_one_line(closed, tmp_path, arguments, said):
    folder, _ = closed
    (tmp_path / "log.csv").write_text("time,q1,q2\n0,1,2\n1,1,2\n")
    (tmp_path / "empty.csv").write_text("")
    places = {"model": folder / "model", "ds": folder / "now" / "ds"}
    places |= {name: tmp_path / f"{name}.csv" for name in ("log", "empty")}
    done = acqd_here(*(each.format(**places) for each in arguments), cwd=tmp_path)
    assert done.returncode == 2 and said in done.stderr, done.stderr
    assert len(done.stderr.strip().splitlines()) == 1 and not (tmp_path / "o").exists()


def test_equipment_that_switches_by_itself_needs_no_motion(closed, tmp_path):
    folder, _ = closed
    report = json.loads((folder / "now" / "ds.loop" / "report.json").read_bytes())
    load = {"where": "cabinet", "confidence": 0.97, "family": {"members": [{"id": "process_load", "where": "cabinet"}]}}
    (tmp_path / "loop").mkdir()
    own = report | {"verdict": "effects_found", "effects": [load | {"id": "thermostat"}]}
    (tmp_path / "loop" / "report.json").write_text(json.dumps(own))
    done = acqd_here("next", tmp_path / "loop", "--out", tmp_path / "next")
    assert done.returncode == 2 and "thermostat or process_load" in done.stderr and "an hour at rest" in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1 and not (tmp_path / "next").exists()


@pytest.mark.parametrize(
    ("change", "said"),
    [({}, "in question already"), ({"robot": "ur3e"}, "robot ur3e"), ({"step_s": 0.1}, "step_s 0.1")],
)
def test_sessions_that_do_not_belong_together_are_refused(closed, tmp_path, change, said):
    folder, _ = closed
    ds = folder / "now" / "ds"
    other = ds
    if change:
        other = tmp_path / "other"
        shutil.copytree(ds, other)
        manifest = json.loads((other / "manifest.json").read_text()) | change
        (other / "manifest.json").write_text(json.dumps(manifest))
    done = acqd_here("close-loop", ds, "--with", other, "--model", folder / "model", "--out", tmp_path / "out")
    assert done.returncode == 2 and said in done.stderr and len(done.stderr.strip().splitlines()) == 1


@pytest.mark.slow("experiment")
def test_a_program_is_written_whole_and_promises_more_than_random_motion(closed, model, tmp_path):
    """A faint payload, in recordings of one joint's motion: other causes look alike."""
    folder, _ = closed
    faint = [
        replace(each, recording=f"f{k}")
        for k, each in enumerate(
            recording(model, k, lambda scene, random: 0.04 * added_payload(scene, random), seed=7, start_s=1e9 + 9e4)
            for k in range(4)
        )
    ]
    ds = write_dataset(tmp_path / "few", faint)
    done = acqd_here("close-loop", ds, "--model", folder / "model", "--json")
    assert done.returncode == 0, done.stderr
    done = acqd_here(
        *("next", f"{ds}.loop", "--minutes", 1, "--limit-speed", 100, "--cause", "payload", "--cause", "gravity_bias"),
        *("--out", tmp_path / "next", "--json"),
    )
    assert done.returncode == 0, done.stderr
    designed = json.loads(done.stdout)
    right = designed["right_name"]
    assert right["random"] <= right["designed"] < 1 - THRESHOLDS.chance
    assert designed["seconds"] <= 60 and designed["cut_s"] == pytest.approx(designed["seconds"] / 4, abs=0.1)
    robot = load_description("ur10e")
    q = read_log(tmp_path / "next" / "motion.csv", robot).q
    assert (q >= robot.lower).all() and (q <= robot.upper).all() and np.ptp(q) > 0.1
    for name in ("next.html", "next.json", "program.script"):
        assert (tmp_path / "next" / name).stat().st_size > 300
