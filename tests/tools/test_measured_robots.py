"""The study of measured robots."""

import importlib.util
import json
import sys

import pytest

from tests.commands import acqd_here
from tests.places import ROBOT_LOGS, ROOT, needs_robot_logs


def loaded():
    """The study as a module."""
    path = ROOT / "tools" / "studies" / "measured_robots" / "__main__.py"
    spec = importlib.util.spec_from_file_location("measured_robots", path)
    tool = importlib.util.module_from_spec(spec)
    sys.modules["measured_robots"] = tool
    spec.loader.exec_module(tool)
    return tool


@needs_robot_logs
@pytest.mark.slow("dataset")
def test_lags_of_measured_ur10e_recordings_are_inside_their_intervals(tmp_path):
    """Power and angles have one clock, so every true lag is 0."""
    tool = loaded()
    tool.prepare(tool.ROBOTS[1], ROBOT_LOGS, tmp_path / "u")
    power, logs = tmp_path / "u" / "power.csv", tmp_path / "u" / "logs"
    done = acqd_here("dataset", "build", "--power", power, "--logs", logs, "--robot", "ur10e", "--out", tmp_path / "ds")
    assert done.returncode == 0, done.stderr
    manifest = json.loads((tmp_path / "ds" / "manifest.json").read_text())
    assert len(manifest["recordings"]) > 15 and not manifest["clock"]["steps"]
    for entry in manifest["recordings"]:
        assert abs(entry["lag_s"]) < entry["lag_within_s"] < 0.03, entry["name"]
        assert abs(entry["lag_s"]) < 0.010, entry["name"]


@needs_robot_logs
def test_a_measured_ur3e_is_explained_from_its_motion_alone(tmp_path):
    tool = loaded()
    tool.prepare(tool.ROBOTS[0], ROBOT_LOGS, tmp_path / "u")
    done = acqd_here(
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


@needs_robot_logs
def test_a_term_withheld_from_a_measured_ur3e_is_the_first_hypothesis_with_its_size(tmp_path):
    """35 s of measured bus power: named, or too few for a name, but not for the first place."""
    tool = loaded()
    tool.prepare(tool.ROBOTS[0], ROBOT_LOGS, tmp_path / "u")
    inputs = ("--power", tmp_path / "u" / "power.csv", "--logs", tmp_path / "u" / "logs", "--robot", "ur3e")
    built = acqd_here("dataset", "build", *inputs, "--lag", "0", "--cut", "5", "--out", tmp_path / "ds")
    assert built.returncode == 0, built.stderr

    def report_without(term):
        bundle, out = tmp_path / term, tmp_path / f"loop-{term}"
        trained = acqd_here("train", tmp_path / "ds", "--network", "grey-box", "--without", term, "--out", bundle)
        assert trained.returncode == 0, trained.stderr
        closed = acqd_here("close-loop", tmp_path / "ds", "--model", bundle, "--out", out, "--json")
        assert closed.returncode == 0, closed.stderr
        return json.loads(closed.stdout)

    for term, where, parameter in (
        ("mechanical_power", "all joints", "share"),
        ("coulomb_friction", "all joints", "torque, relative"),
    ):
        report = report_without(term)
        first = [*report["effects"], *report["hypotheses"]][0]
        assert (first["id"], first["where"]) == (term, where)
        assert first["parameters"][parameter]["value"] == pytest.approx(1.0, abs=0.25)


MILL = ROOT / "tools" / "studies" / "measured_robots" / "mill.toml"


def mill_dataset(tmp_path, recordings):
    logs = tmp_path / "logs"
    logs.mkdir()
    for number in recordings:
        (logs / f"{number}.csv").symlink_to(ROBOT_LOGS / "cnc_mill" / f"experiment_{number}.csv")
    inputs = ("--power", "log", "--logs", logs, "--robot", MILL, "--step", "0.1")
    return acqd_here("dataset", "build", *inputs, "--out", tmp_path / "ds")


@needs_robot_logs
def test_two_axes_of_a_milling_machine_are_explained_from_the_recording_as_it_was_published(tmp_path):
    """Positions of a few digits without a time, mm and kW."""
    built = mill_dataset(tmp_path, ["01"])
    assert built.returncode == 0, built.stderr
    assert "its speed is integrated" in built.stderr
    r2, _, recordings = loaded().cross_validated(tmp_path / "ds", folds=3)
    assert recordings >= 10 and r2 > 0.6


@needs_robot_logs
def test_recordings_of_the_mill_whose_seconds_are_out_of_order_are_refused(tmp_path):
    built = mill_dataset(tmp_path, ["03", "08", "12"])
    assert built.returncode == 2 and "none of 3 logs can be used" in built.stderr
    assert " m in 0." in built.stderr
