"""`acqd train`, `acqd compare`, `acqd predict` as a user runs them, on a small campaign and on a measured robot."""

import importlib.util
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from acqd.dataset.build import BuildConfig, build
from acqd.lab.campaign.run import CampaignConfig, run_campaign
from acqd.lab.settings import CampaignSettings

DATA = Path(__file__).parents[2] / "shared" / "data" / "robots"


def acqd(*arguments, **environment):
    done = subprocess.run(
        [sys.executable, "-m", "acqd", *map(str, arguments)],
        capture_output=True,
        text=True,
        env=os.environ | {"OMP_NUM_THREADS": "1", "COLUMNS": "160"} | environment,
    )
    assert "Traceback" not in done.stderr, done.stderr
    return done


@pytest.fixture(scope="module")
def campaign(tmp_path_factory):
    folder = tmp_path_factory.mktemp("models")
    settings = CampaignSettings(limited=6, all_space=6, limited_sources=3, all_space_sources=3, session=6, seed=21)
    run_campaign(
        CampaignConfig(settings, folder / "c", folder / "t", f"{folder}/c/power.sqlite", 2), lambda what, share: None
    )
    build(
        BuildConfig(f"{folder}/c/power.sqlite", folder / "c" / "logs", folder / "ds", "iiwa7_r800"),
        lambda what, share: None,
    )
    return folder


@pytest.fixture(scope="module")
def trained(campaign):
    results = {}
    for network, more in (
        ("grey-box", ()),
        ("hybrid", ()),
        ("21x1dim", ("--epochs", 40, "--seed", 1, "--seed", 2)),
        ("3conv1x5", ("--epochs", 5)),
    ):
        done = acqd("train", campaign / "ds", "--network", network, *more, "--json")
        assert done.returncode == 0, done.stderr
        for each in json.loads(done.stdout):
            results[Path(each["bundle"]).name] = each
    return results


def test_models_are_trained_compared_and_the_grey_box_is_best(campaign, trained):
    assert set(trained) == {
        "grey-box-everything-s1",
        "hybrid-everything-s1",
        "3conv1x5-everything-s1",
        "21x1dim-everything-s1",
        "21x1dim-everything-s2",
    }
    done = acqd("compare", campaign / "ds", "--out", campaign / "report.html", "--json")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    mae = {model["name"]: model["test"]["everything"]["mae"] for model in found["models"] + found["baselines"]}
    assert found["measured"] == "simulated" and 0.1 < found["noise_floor_W"] < 1.5
    assert found["noise_floor_W"] < mae["grey-box"] < 2.0 < min(mae["21x1dim"], mae["constant"])  # 40 epochs are few
    assert mae["hybrid"] < 1.1 * mae["grey-box"] and mae["linear physics"] < mae["constant"]
    seeds = {model["name"]: model["seeds"] for model in found["models"]}
    assert seeds["21x1dim"] == 2
    page = (campaign / "report.html").read_text()
    assert "simulated data" in page and page.count("data:image/png") >= 6 and "http" not in page
    for title in ("Figure 8.16", "Kernels of 3conv1x5", "Parameters of grey-box"):
        assert title in page


def test_a_log_is_predicted_and_what_is_new_to_the_model_is_flagged(campaign, trained, tmp_path):
    bundle = campaign / "ds.models" / "grey-box-everything-s1"
    log = sorted((campaign / "c" / "logs").rglob("*.log"))[0]
    done = acqd("predict", bundle, log, "--out", tmp_path / "p.csv", "--json")
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout)
    rows = np.genfromtxt(tmp_path / "p.csv", delimiter=",", names=True)
    assert summary["rows"] == len(rows) and summary["outside_envelope"] < 0.1
    assert 150 < summary["mean_W"] < 230
    assert summary["energy_kWh"] == pytest.approx(rows["P_predicted_W"].sum() * 0.04 / 3.6e6, rel=1e-4)
    limited = acqd("train", campaign / "ds", "--network", "grey-box", "--on", "limited", "--out", tmp_path / "limited")
    assert limited.returncode == 0, limited.stderr
    wide = next(path for path in sorted((campaign / "c" / "logs").rglob("*.log")) if "all_" in path.name)
    done = acqd("predict", tmp_path / "limited", wide)
    assert done.returncode == 0 and "outside the range of motion of the training data" in done.stderr


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (("train", "{ds}", "--network", "22x1dim"), "no network '22x1dim'"),
        (("train", "{ds}"), "name one --network"),
        (("train", "{ds}", "--network", "grey-box", "--on", "outer space"), "no trajectories 'outer space'"),
        (("train", "{tmp}", "--network", "grey-box"), "is not a dataset"),
        (("train", "{ds}", "--table-7-1", "--out", "x"), "--out is the folder of one bundle"),
        (("train", "{ds}", "--network", "hybrid", "--robot", "ur10e"), "axes"),
        (("compare", "{ds}", "--models", "{tmp}"), "no bundles there"),
        (("predict", "{tmp}", "{log}"), "is not a bundle"),
        (("predict", "{ds}.models/grey-box-everything-s1", "{tmp}/none.log"), "cannot be read"),
    ],
)
def test_bad_input_is_named(campaign, trained, tmp_path, arguments, expected):
    log = sorted((campaign / "c" / "logs").rglob("*.log"))[0]
    done = acqd(*(text.format(ds=campaign / "ds", tmp=tmp_path, log=log) for text in arguments))
    assert done.returncode == 2, done.stderr
    assert expected in done.stderr and len(done.stderr.strip().splitlines()) == 1
    assert not list(tmp_path.iterdir())


def test_logs_that_are_not_this_robots_are_refused(campaign, trained, tmp_path):
    bundle = campaign / "ds.models" / "grey-box-everything-s1"
    lines = ["time," + ",".join(f"q{k}" for k in range(1, 8))]
    lines += [f"{0.04 * k:.2f}," + ",".join(["57.3"] * 7) for k in range(100)]
    (tmp_path / "degrees.csv").write_text("\n".join(lines))
    (tmp_path / "six.csv").write_text("\n".join(line.rpartition(",")[0] for line in lines).replace("57.3", "0.5"))
    for name, expected in (("degrees.csv", "degrees"), ("six.csv", "7 axes")):
        done = acqd("predict", bundle, tmp_path / name)
        assert done.returncode == 2 and expected in done.stderr, done.stderr


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


@pytest.mark.skipif(not DATA.is_dir(), reason="../shared/data is not there")
def test_a_measured_ur3e_is_explained_from_its_motion_alone(tmp_path):
    path = Path(__file__).parents[1] / "tools" / "studies" / "measured_robots" / "__main__.py"
    spec = importlib.util.spec_from_file_location("measured_robots", path)
    tool = importlib.util.module_from_spec(spec)
    sys.modules["measured_robots"] = tool
    spec.loader.exec_module(tool)
    tool.prepare(tool.ROBOTS[0], DATA, tmp_path / "u")
    done = acqd(
        "dataset",
        "build",
        "--power",
        tmp_path / "u" / "power.csv",
        "--logs",
        tmp_path / "u" / "logs",
        "--robot",
        "ur3e",
        "--lag",
        "0",
        "--cut",
        "2.5",
        "--out",
        tmp_path / "ds",
    )
    assert done.returncode == 0, done.stderr
    assert json.loads((tmp_path / "ds" / "manifest.json").read_text())["measured"] == "mains"  # at the bus, not derived
    r2, mae, pieces = tool.cross_validated(tmp_path / "ds")
    assert pieces == 10 and r2 > 0.86 and mae < 1.7


def test_predicting_needs_neither_a_robot_library_nor_parquet(campaign, trained):
    blocked = ("pinocchio", "pyarrow", "matplotlib", "coal")
    log = sorted((campaign / "c" / "logs").rglob("*.log"))[0]
    for bundle in sorted((campaign / "ds.models").glob("*-s1")):
        code = f"import sys; sys.modules.update(dict.fromkeys({blocked!r})); from acqd.cli.main import main; main()"
        done = subprocess.run([sys.executable, "-c", code, "predict", bundle, log], capture_output=True, text=True)
        assert done.returncode == 0, done.stderr
