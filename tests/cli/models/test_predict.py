"""`acqd predict` as a user runs it."""

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import acqd.robot
from tests.commands import acqd_here


def test_a_log_is_predicted_and_what_is_new_to_the_model_is_flagged(training, trained, logs, tmp_path):
    bundle = trained[0] / "grey-box-everything-s1"
    done = acqd_here("predict", bundle, logs[0], "--out", tmp_path / "p.csv", "--json")
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout)
    rows = np.genfromtxt(tmp_path / "p.csv", delimiter=",", names=True)
    assert summary["rows"] == len(rows) and summary["outside_envelope"] < 0.1
    assert 150 < summary["mean_W"] < 230
    assert summary["energy_kWh"] == pytest.approx(rows["P_predicted_W"].sum() * 0.04 / 3.6e6, rel=1e-4)
    limited = acqd_here("train", training, "--network", "grey-box", "--on", "limited", "--out", tmp_path / "limited")
    assert limited.returncode == 0, limited.stderr
    wide = next(path for path in logs if "all_" in path.name)
    done = acqd_here("predict", tmp_path / "limited", wide)
    assert done.returncode == 0 and "outside the range of motion of the training data" in done.stderr


def test_logs_that_are_not_this_robots_are_refused(trained, tmp_path):
    bundle = trained[0] / "grey-box-everything-s1"
    lines = ["time," + ",".join(f"q{k}" for k in range(1, 8))]
    lines += [f"{0.04 * k:.2f}," + ",".join(["57.3"] * 7) for k in range(100)]
    (tmp_path / "degrees.csv").write_text("\n".join(lines))
    (tmp_path / "six.csv").write_text("\n".join(line.rpartition(",")[0] for line in lines).replace("57.3", "0.5"))
    for name, expected in (("degrees.csv", "degrees"), ("six.csv", "7 axes")):
        done = acqd_here("predict", bundle, tmp_path / name)
        assert done.returncode == 2 and expected in done.stderr, done.stderr


def test_a_log_of_another_robot_is_doubted(trained, logs, tmp_path):
    bundle, other = trained[0] / "grey-box-everything-s1", tmp_path / "of.toml"
    text = (Path(acqd.robot.__file__).parent / "descriptions" / "iiwa7_r800.toml").read_text()
    other.write_text(text.replace('name = "iiwa7_r800"', 'name = "iiwa7_with_tool"'))
    done = acqd_here("predict", bundle, logs[0], "--robot", other, "--json")
    assert done.returncode == 0 and "read as a log of iiwa7_with_tool, but the model is of iiwa7_r800" in done.stderr
    assert "is that meant?" in json.loads(done.stdout)["left_out"]


def test_predicting_needs_neither_a_robot_library_nor_parquet(trained, logs):
    code = """
import sys
sys.modules.update(dict.fromkeys(("pinocchio", "pyarrow", "matplotlib", "coal")))
from acqd.cli.commands import command_tree
for bundle in sys.argv[2:]:
    command_tree(["predict"])(["predict", bundle, sys.argv[1]], standalone_mode=False)
"""
    bundles = sorted(trained[0].glob("*-s1"))
    assert len(bundles) == 4
    done = subprocess.run([sys.executable, "-c", code, logs[0], *bundles], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
