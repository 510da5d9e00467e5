"""`acqd train` as a user runs it."""

import json
import shutil
from pathlib import Path

import pytest

from tests.commands import acqd, acqd_here, without_workers


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (("train", "{ds}", "--network", "22x1dim"), "no network '22x1dim'"),
        (("train", "{ds}"), "which model? --network grey-box"),
        (("train", "{ds}", "--network", "grey-box", "--on", "outer space"), "no trajectories 'outer space'"),
        (("train", "{tmp}", "--network", "grey-box"), "is not a dataset"),
        (("train", "{ds}", "--table-7-1", "--out", "x"), "--out is the folder of one bundle"),
        (("train", "{ds}", "--network", "hybrid", "--robot", "ur10e"), "axes"),
        (("compare", "{ds}", "--models", "{tmp}"), "no bundles there"),
        (("predict", "{tmp}", "{log}"), "is not a bundle"),
        (("predict", "{models}/grey-box-everything-s1", "{tmp}/none.log"), "no such file"),
    ],
)
def test_bad_input_is_named(training, trained, logs, tmp_path, arguments, expected):
    places = {"ds": training, "models": trained[0], "log": logs[0], "tmp": tmp_path}
    done = acqd_here(*(text.format(**places) for text in arguments))
    assert done.returncode == 2, done.stderr
    assert expected in done.stderr and len(done.stderr.strip().splitlines()) == 1
    assert not list(tmp_path.iterdir())


@pytest.mark.slow("models")
def test_without_a_compiler_torch_trains(training, tmp_path):
    done = acqd(
        "train",
        training,
        "--network",
        "7x1dim",
        "--epochs",
        1,
        "--out",
        tmp_path / "b",
        "--json",
        PATH="/nonexistent",
        XDG_CACHE_HOME=str(tmp_path),  # not what has been compiled before
        CC="",
    )
    assert done.returncode == 0, done.stderr
    assert "torch" in json.loads(done.stdout)[0]["training"]["engine"]
    asked = acqd(
        "train",
        training,
        "--network",
        "7x1dim",
        "--compute",
        "fused",
        "--out",
        tmp_path / "c",
        PATH="/nonexistent",
        XDG_CACHE_HOME=str(tmp_path / "cache"),
    )
    assert asked.returncode == 1 and "no C compiler" in asked.stderr and not (tmp_path / "c").exists()


@pytest.mark.slow("cli.models.train")
def test_table_7_1_is_fourteen_trainings_and_done_ones_are_kept(study, tmp_path):
    models = shutil.copytree(study.models, tmp_path / "m")
    stamps = {path: path.stat().st_mtime_ns for path in models.glob("*/bundle.json")}
    assert len(stamps) == 14
    lost = models / "7x1dim-limited-s1"
    shutil.rmtree(lost)
    with without_workers():
        again = acqd_here("train", study.training, "--table-7-1", "--epochs", 4, "--models", models, "--json")
    assert again.returncode == 0, again.stderr
    assert {Path(bundle["bundle"]) for bundle in json.loads(again.stdout)} == {path.parent for path in stamps}
    made_again = [path for path in stamps if path.stat().st_mtime_ns != stamps[path]]
    assert made_again == [lost / "bundle.json"]
