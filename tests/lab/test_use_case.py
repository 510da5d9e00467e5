"""The assembly of the thesis' use case."""

import numpy as np
import pytest

from acqd.errors import UserError
from acqd.lab.campaign.use_case import Assembly
from acqd.motion.controller import Controller
from acqd.motion.excitation import planned_path
from acqd.motion.program import Planner
from acqd.robot.collision import CollisionChecker
from acqd.robot.scene import Box, Scene
from tests.lab.moved import IIWA


def test_an_assembly_does_not_drive_through_what_stands_in_its_way(cell):
    post = Box(name="post", centre=(0.54, -0.14, 0.3), size=(0.03, 0.03, 0.6))
    blocked = Planner(cell.arm, CollisionChecker(cell.arm, Scene(name="blocked", box=[post])))
    with pytest.raises(UserError, match=r"the straight path to .* deg collides"):
        Assembly(cell.arm, blocked).program(np.random.default_rng(0))
    for controller in ("robot", "twin"):
        assembly = Assembly(cell.arm, cell.planner, controller)
        motion = Controller(IIWA, assembly.home()).run(assembly.program(np.random.default_rng(0)))
        assert not cell.checker.path_collides(planned_path(motion.q))
