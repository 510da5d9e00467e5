"""`acqd robot` as a user runs it: from a URDF to a checked description."""

import json

import pytest

from tests.commands import acqd_here, refused
from tests.robot.urdf.files import GRIPPER, arm


@pytest.fixture
def urdf(tmp_path):
    path = tmp_path / "little.urdf"
    path.write_text(arm())
    return path


def test_from_a_urdf_to_a_report(tmp_path, urdf):
    made = json.loads(acqd_here("robot", "from-urdf", urdf, "--json", cwd=tmp_path).stdout)
    assert made["joints"] == ["rail", "shoulder", "elbow"]
    done = acqd_here("robot", "check", made["out"], "--out", "arm.html", "--json", cwd=tmp_path)
    checked = json.loads(done.stdout)
    assert "drive" in checked["guessed"]["elbow"]
    assert checked["influences"][0]["change_W"] > 0
    # a made-up tensor in the file: exit 1 tells scripts
    assert done.returncode == int(any(each["state"] == "wrong" for each in checked["findings"]))
    page = (tmp_path / "arm.html").read_text()
    assert page.count("<svg") == 1 and 'class="bars"' in page and "What is guessed" in page
    assert "is there already" in refused(acqd_here("robot", "from-urdf", urdf, cwd=tmp_path))


def test_people_read_what_is_guessed(tmp_path, urdf):
    shown = acqd_here("robot", "from-urdf", urdf, "--out", "mine.toml", cwd=tmp_path).stdout
    assert "guessed: acceleration_m_s2, drive, friction of rail" in shown
    shown = acqd_here("robot", "check", "mine.toml", cwd=tmp_path).stdout
    assert "guessed of rail: acceleration_m_s2, drive, friction" in shown
    assert "W on average" in shown


def test_shipped_robots_are_listed(tmp_path):
    rows = {row["name"]: row for row in json.loads(acqd_here("robot", "list", "--json", cwd=tmp_path).stdout)}
    assert {"axes": 6, "drives": "gains known"}.items() <= rows["ur10e"].items()
    assert rows["ur10e"]["logs"] == ["csv", "csv", "ros"]
    assert rows["xarm7"]["drives"] == "guessed" and "BSD" in rows["xarm7"]["sources"][0]
    assert "gains" in acqd_here("robot", "list", cwd=tmp_path).stdout


def test_mistakes_are_one_line_and_leave_nothing(tmp_path, urdf):
    urdf.write_text(arm(*GRIPPER))
    assert "--tip: tool0, left, right" in refused(acqd_here("robot", "from-urdf", urdf, cwd=tmp_path))
    assert "ends in .toml" in refused(
        acqd_here("robot", "from-urdf", urdf, "--tip", "tool0", "--out", "x.json", cwd=tmp_path)
    )
    assert "robot 'r2d2' is unknown" in refused(acqd_here("robot", "check", "r2d2", cwd=tmp_path))
    assert sorted(path.name for path in tmp_path.iterdir()) == ["little.urdf"]
    result = acqd_here("robot", "check", "--help", cwd=tmp_path)
    assert "Example:" in result.stdout and "--json" in result.stdout
