"""`acqd train` as a user runs it."""

import json

import pytest

from tests.commands import acqd, acqd_here


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (("train", "{ds}", "--network", "22x1dim"), "no network '22x1dim'"),
        (("train", "{ds}"), "name one --network"),
        (("train", "{ds}", "--network", "grey-box", "--on", "outer space"), "no trajectories 'outer space'"),
        (("train", "{tmp}", "--network", "grey-box"), "is no dataset"),
        (("train", "{ds}", "--table-7-1", "--out", "x"), "--out is one bundle"),
        (("train", "{ds}", "--network", "hybrid", "--robot", "ur10e"), "axes"),
        (("compare", "{ds}", "--models", "{tmp}"), "no bundles there"),
        (("predict", "{tmp}", "{log}"), "is no bundle"),
        (("predict", "{ds}.models/grey-box-everything-s1", "{tmp}/none.log"), "cannot be read"),
    ],
)
def test_bad_input_is_named(campaign, trained, tmp_path, arguments, expected):
    log = sorted((campaign / "campaign" / "logs").rglob("*.log"))[0]
    done = acqd_here(*(text.format(ds=campaign / "ds", tmp=tmp_path, log=log) for text in arguments))
    assert done.returncode == 2, done.stderr
    assert expected in done.stderr and len(done.stderr.strip().splitlines()) == 1
    assert not list(tmp_path.iterdir())


def test_without_a_compiler_torch_trains(campaign, tmp_path):
    done = acqd(
        "train",
        campaign / "ds",
        "--network",
        "7x1dim",
        "--epochs",
        1,
        "--out",
        tmp_path / "b",
        "--json",
        PATH="/nonexistent",
        CC="",
    )
    assert done.returncode == 0, done.stderr
    assert "torch" in json.loads(done.stdout)[0]["training"]["engine"]
    asked = acqd(
        "train",
        campaign / "ds",
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


def test_table_7_1_is_fourteen_trainings_and_done_ones_are_kept(campaign, tmp_path):
    first = acqd("train", campaign / "ds", "--table-7-1", "--epochs", 1, "--models", tmp_path / "m", "--json")
    assert first.returncode == 0, first.stderr
    made = json.loads(first.stdout)
    assert len({each["bundle"] for each in made}) == 14
    stamps = {path: path.stat().st_mtime_ns for path in (tmp_path / "m").glob("*/bundle.json")}
    again = acqd("train", campaign / "ds", "--table-7-1", "--epochs", 1, "--models", tmp_path / "m", "--json")
    assert again.returncode == 0 and json.loads(again.stdout) == made
    assert stamps == {path: path.stat().st_mtime_ns for path in (tmp_path / "m").glob("*/bundle.json")}
