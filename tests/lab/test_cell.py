"""A cell refuses robots that the laboratory cannot move."""

import pytest

from acqd.errors import UserError
from acqd.lab.cell import build_cell
from acqd.lab.settings import LabSettings
from acqd.robot.toml_text import description_text
from acqd.robot.urdf.describe import describe_urdf
from tests.robot.urdf.files import arm


def test_a_prismatic_joint_is_refused_by_name(tmp_path):
    (tmp_path / "little.urdf").write_text(arm())
    path = tmp_path / "little.toml"
    path.write_text(description_text(describe_urdf(tmp_path / "little.urdf").table))
    with pytest.raises(UserError, match="joint rail is prismatic, and the laboratory moves revolute joints only"):
        build_cell(LabSettings(robot=str(path)))


def test_a_robot_without_a_plant_is_refused_by_name():
    with pytest.raises(UserError, match="robot fr3 has no plant file"):
        build_cell(LabSettings(robot="fr3"))
