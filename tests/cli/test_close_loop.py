"""`acqd close-loop` as a user runs it."""

import json
import shutil
import subprocess
import sys
from dataclasses import replace

import pytest

from acqd.discrepancy.config import CloseConfig
from acqd.discrepancy.recordings import subject_of
from acqd.errors import UserError
from acqd.models.bundle.bundle import load_bundle
from tests.builders import recording, write_dataset
from tests.commands import acqd_here
from tests.waiting import LIMIT_S


@pytest.mark.long(seconds=30)
def test_close_loop_names_the_payload_and_writes_what_the_design_says(closed):
    folder, report = closed
    fixed = {"target", "unit", "measured", "recordings", "noise_floor", "before", "after", "verdict", "effects"}
    assert fixed | {"unexplained"} <= set(report)
    assert (report["target"], report["unit"], report["measured"]) == ("P", "W", "simulated")
    assert (
        set(report["before"])
        == set(report["after"])
        == {"mae", "rmse", "bias", "whiteness", "residual_autocorrelation"}
    )
    assert report["verdict"] == "effects_found"
    effect = report["effects"][0]
    keys = {"id", "where", "parameters", "delta_rmse", "share_of_explainable", "confidence", "rivals", "evidence"}
    assert effect["id"] == "payload" and keys <= set(effect)
    mass = effect["parameters"]["mass"]
    assert mass["unit"] == "kg" and mass["ci95"][0] < mass["value"] < mass["ci95"][1]
    assert mass["value"] == pytest.approx(2.0, rel=0.15)
    year = effect["a_year"]
    assert year["kWh_ci95"][0] < year["kWh"] < year["kWh_ci95"][1] and year["EUR"] is None
    assert 0.0 < year["duty"] <= 1.0 and year["recordings"] == report["recordings"]["held_out"]
    assert report["after"]["rmse"] < 0.6 * report["before"]["rmse"]
    assert report["reference_rmse"] < report["after"]["rmse"]
    written = json.loads((folder / "now" / "ds.loop" / "report.json").read_text())
    assert written["effects"] == report["effects"]
    page = (folder / "now" / "ds.loop" / "report.html").read_text()
    assert "simulated data" in page and "payload: a year" in page and page.count('<svg role="img"') >= 6


@pytest.mark.slow("cli.close_loop")
def test_the_augmented_bundle_predicts_and_can_be_closed_on_again(closed, tmp_path):
    folder, report = closed
    augmented = folder / "now" / "ds.loop" / "model"
    assert [each["id"] for each in load_bundle(augmented).metadata["effects"]] == [e["id"] for e in report["effects"]]
    log = next((folder / "now" / "logs").iterdir())
    before, after = (json.loads(acqd_here("predict", b, log, "--json").stdout) for b in (folder / "model", augmented))
    assert after["mean_W"] != pytest.approx(before["mean_W"], abs=0.05)
    again = acqd_here(
        *("close-loop", folder / "before" / "ds", "--model", augmented),
        *("--max-effects", 1, "--out", tmp_path / "again", "--json"),
    )
    assert again.returncode == 0, again.stderr
    found = json.loads(again.stdout)
    assert [e["id"] for e in found["effects"]][:1] == ["payload"]  # it has gone again: a mass of minus two kg
    assert found["effects"][0]["parameters"]["mass"]["value"] == pytest.approx(-2.0, rel=0.2)


@pytest.mark.slow("cli.close_loop")
def test_the_same_seed_gives_the_same_report(closed, tmp_path):
    folder, report = closed
    again = acqd_here(
        "close-loop", folder / "now" / "ds", "--model", folder / "model", "--out", tmp_path / "twin", "--json"
    )
    second = json.loads(again.stdout)
    assert {k: v for k, v in second.items() if k != "out"} == {k: v for k, v in report.items() if k != "out"}


@pytest.mark.slow("cli.close_loop")
def test_only_and_exclude(closed, tmp_path):
    folder, _ = closed
    common = ("close-loop", folder / "now" / "ds", "--model", folder / "model", "--json", "--out")
    without = json.loads(acqd_here(*common, tmp_path / "w", "--exclude", "payload", "--max-effects", 1).stdout)
    assert "payload" not in [each["id"] for each in without["effects"]]
    assert without["after"]["rmse"] <= without["before"]["rmse"]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (("nowhere", "--model", "{model}"), "nowhere"),
        (("{ds}", "--model", "{ds}"), "no bundle"),
        (("{ds}", "--model", "{model}", "--only", "paylod"), "paylod"),
        (("{ds}", "--model", "{model}", "--reference", "{model}"), "model"),
        (("{ds}", "--model", "{model}", "--out", "{ds}"), "choose another --out"),
        (("{ds}", "--model", "{model}", "--robot", "kuka_iiwa14"), "kuka_iiwa14 has 7 axes"),
    ],
)
def test_bad_input_is_one_line_and_exit_2(closed, arguments, said):
    folder, _ = closed
    places = {"model": folder / "model", "ds": folder / "now" / "ds"}
    done = acqd_here("close-loop", *(each.format(**places) for each in arguments))
    assert done.returncode == 2
    assert said in done.stderr and len(done.stderr.strip().splitlines()) == 1


def test_a_model_of_another_robot_is_refused_and_an_empty_search_too(closed, tmp_path):
    folder, _ = closed
    shutil.copytree(folder / "now" / "ds", tmp_path / "ds")
    manifest = tmp_path / "ds" / "manifest.json"
    manifest.write_bytes(manifest.read_bytes().replace(b'"robot": "ur10e"', b'"robot": "ur5e"'))
    config = CloseConfig(tmp_path / "ds", folder / "model", tmp_path / "out")
    with pytest.raises(UserError, match="the dataset is of ur5e, the model is of ur10e: use a model of this robot"):
        subject_of(config, lambda *_: None)
    assert any("is that meant?" in note for note in subject_of(replace(config, robot="ur5e"), lambda *_: None).notes)
    nothing = replace(config, dataset=folder / "now" / "ds", only=("payload",), exclude=("payload",))
    with pytest.raises(UserError, match="leave no effect to search for"):
        subject_of(nothing, lambda *_: None)


def test_a_copy_of_a_recording_is_no_further_evidence(model, closed, tmp_path):
    folder, _ = closed
    recordings = [recording(model, k, seed=6, rows=300) for k in range(6)]
    twice = [(each, f"{each.recording}_again") for each in recordings[:2]]
    copies = [replace(each, recording=name, start_s=each.start_s + 7200) for each, name in twice]
    ds = write_dataset(tmp_path, [*recordings, *copies])
    subject = subject_of(CloseConfig(ds, folder / "model", tmp_path / "out"), lambda *_: None)
    assert len({each.recording for each in [*subject.fit, *subject.held_out]}) == 6
    note = next(note for note in subject.notes if "left out" in note)
    assert "same power and angles" in note and all(each.recording in note for each in copies)


@pytest.mark.parametrize(("robot", "notes"), [("ur5e", 1), (None, 0)])
def test_a_description_of_another_robot_is_noted(closed, tmp_path, robot, notes):
    folder, _ = closed
    config = CloseConfig(folder / "now" / "ds", folder / "model", tmp_path / "out", robot=robot)
    said = [note for note in subject_of(config, lambda *_: None).notes if "is that meant?" in note]
    assert len(said) == notes and all("ur5e" in note and "ur10e" in note for note in said)


def test_too_few_recordings_are_refused(model, closed, tmp_path):
    folder, _ = closed
    few = write_dataset(tmp_path, [recording(model, k, seed=6) for k in range(3)])
    done = acqd_here("close-loop", few, "--model", folder / "model")
    assert done.returncode == 2 and "too few" in done.stderr


def test_many_pieces_that_are_too_short_are_refused(model, closed, tmp_path):
    folder, _ = closed
    short = write_dataset(tmp_path, [recording(model, k, seed=6, rows=60) for k in range(3)])
    done = acqd_here("close-loop", short, "--model", folder / "model")
    assert done.returncode == 2 and "3 recordings of at least 1.8 s" in done.stderr


@pytest.mark.parametrize("words", [("--watch", "--since", "2026-01-01"), ("--every", "2")])
def test_options_that_would_do_nothing_are_refused(closed, words):
    folder, _ = closed
    done = acqd_here("close-loop", folder / "now" / "ds", "--model", folder / "model", *words)
    assert done.returncode == 2 and "--watch" in done.stderr and len(done.stderr.strip().splitlines()) == 1


def test_a_watch_by_command_tells_line_by_line_until_it_is_asked_to_stop(closed, tmp_path):
    folder, _ = closed
    command = [
        *(sys.executable, "-m", "acqd", "close-loop", folder / "before" / "ds", "--model", folder / "model"),
        *("--out", tmp_path / "watch", "--watch", "--json", "--every", "0.5"),
    ]
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        first = json.loads(process.stdout.readline())
        assert first["event"] == "recording"
        process.terminate()
        rest, errors = process.communicate(timeout=LIMIT_S)
    assert process.returncode == 0 and not errors
    assert not [line for line in rest.splitlines() if json.loads(line)["event"] == "alarm"]


@pytest.mark.slow("cli.close_loop")
def test_a_withheld_term_is_named_and_comes_back(closed, tmp_path):
    folder, _ = closed
    ds = folder / "before" / "ds"
    poor = tmp_path / "poor"
    done = acqd_here("train", ds, "--network", "grey-box", "--without", "coulomb_friction", "--out", poor)
    assert done.returncode == 0, done.stderr
    words = ("close-loop", ds, "--model", poor, "--max-effects", 1, "--out", tmp_path / "poor.loop", "--json")
    report = json.loads(acqd_here(*words).stdout)
    assert [each["id"] for each in report["effects"]][:1] == ["coulomb_friction"]
    assert report["after"]["rmse"] < 0.9 * report["before"]["rmse"]
    assert load_bundle(tmp_path / "poor.loop" / "model").metadata["withheld"] == []


@pytest.mark.slow("cli.robot.calibrate")
def test_a_known_mass_calibrates_the_torques_of_the_model(closed, tmp_path):
    folder, _ = closed
    words = ("robot", "calibrate", folder / "now" / "ds", "--model", folder / "model", "--out", tmp_path / "scaled")
    said = json.loads(acqd_here(*words, "--known-mass", 2.0, "--json").stdout)
    low, high = said["torque_scale"]["ci95"]
    assert low < said["torque_scale"]["value"] < high
    assert load_bundle(tmp_path / "scaled").metadata["torque_scale"]["known_mass_kg"] == 2.0


def test_ability_of_endless_minutes_is_refused(tmp_path):
    done = acqd_here("robot", "ability", tmp_path, "--minutes", "inf")
    assert done.returncode == 2 and "--minutes" in done.stderr and len(done.stderr.strip().splitlines()) == 1


@pytest.mark.slow("cli.robot.ability")
def test_ability_says_beforehand_what_the_motion_of_the_reference_can_tell(closed, tmp_path):
    folder, report = closed
    done = acqd_here("robot", "ability", folder / "model", "--minutes", 60, "--json")
    assert done.returncode == 0, done.stderr
    said = json.loads(done.stdout)
    assert said["minutes"] == 60 and said["power"] == 0.95
    planned = {(each["id"], each["where"]): each for each in said["effects"]}
    recorded = {(each["id"], each["where"]): each for each in report["ability"]["effects"]}
    for key in (("payload", "flange"), ("coulomb_friction", "joint 2")):
        assert 0 < planned[key]["smallest"] < recorded[key]["smallest"]  # an hour tells more than four minutes
        assert 0 < planned[key]["with_twice_the_minutes"] <= planned[key]["smallest"]
    payload = next(each for each in report["effects"] if each["id"] == "payload")
    assert payload["parameters"]["mass"]["value"] > recorded["payload", "flange"]["smallest"]
    page = (folder / "now" / "ds.loop" / "report.html").read_text()
    assert "What these recordings can tell" in page
    named = json.loads((folder / "model" / "bundle.json").read_text())
    other = tmp_path / "other"
    shutil.copytree(folder / "model", other)
    (other / "bundle.json").write_text(json.dumps(named | {"robot": "another"}))
    done = acqd_here("robot", "ability", other, "--motion", folder / "now" / "ds")
    assert done.returncode == 2 and "the model of another" in done.stderr
    forgetful = tmp_path / "forgetful"
    shutil.copytree(folder / "model", forgetful)
    (forgetful / "reference.safetensors").unlink()
    done = acqd_here("robot", "ability", forgetful)
    assert (
        done.returncode == 2 and "reference.safetensors: is missing" in done.stderr and "Traceback" not in done.stderr
    )
