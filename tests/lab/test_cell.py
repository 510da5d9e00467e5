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


def test_another_session_measures_the_same_robot_only_with_the_seed_of_the_robot():
    first, other, same = (
        build_cell(LabSettings(seed=seed, robot_seed=robot_seed)) for seed, robot_seed in ((1, None), (2, None), (2, 1))
    )
    masses = [[joint.link.mass for joint in cell.true_arm.description.joint] for cell in (first, other, same)]
    assert masses[0] == masses[2] != masses[1]
    assert first.random(3).random() != same.random(3).random()  # other motions, another noise
