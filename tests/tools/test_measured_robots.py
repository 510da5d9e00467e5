"""The study of measured robots."""

import importlib.util
import json
import sys

from tests.commands import acqd_here
from tests.places import ROBOT_LOGS, ROOT, needs_robot_logs


@needs_robot_logs
def test_a_measured_ur3e_is_explained_from_its_motion_alone(tmp_path):
    path = ROOT / "tools" / "studies" / "measured_robots" / "__main__.py"
    spec = importlib.util.spec_from_file_location("measured_robots", path)
    tool = importlib.util.module_from_spec(spec)
    sys.modules["measured_robots"] = tool
    spec.loader.exec_module(tool)
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
