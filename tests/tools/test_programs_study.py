"""The study of designed programs sees what MuJoCo sees."""

from dataclasses import replace

import numpy as np
import pytest

from acqd.experiment.pieces import Piece, motion_of
from acqd.motion.chain import Move
from acqd.robot.description import load_description
from tools.studies.programs import Judge, drawn, situation


@pytest.fixture(scope="module")
def made():
    return situation(load_description("iiwa7_r800"), np.random.default_rng([1, 0, 3]))


def test_a_piece_within_the_space_keeps_everything(made):
    space, scene = made
    stroke = tuple(Move(space.home + turn, *(share / 2 for share in space.greatest_shares)) for turn in (0.05, 0.0))
    seconds = motion_of(space, stroke).seconds
    checked = Judge(space, scene)(Piece("stroke", False, stroke, seconds))
    assert checked.broken == () and checked.clearance_m > 0
    program = drawn([checked], 10 * seconds + 0.1, np.random.default_rng(1))
    assert len(program) == 10


def test_an_arm_in_the_table_collides_and_leaves_the_workspace(made):
    space, scene = made
    low = np.radians([0, 110, 0, 0, 0, 0, 0])
    piece = Piece("low", False, (Move(low, 0.3, 0.05), Move(space.home, 0.3, 0.05)), 1.0)
    assert "collision" in Judge(space, scene)(piece).broken
    beside = replace(space, workspace=(9.0, 9.0, 9.0, 9.1, 9.1, 9.1), speed=space.speed / 1e3)
    broken = Judge(beside, scene)(piece).broken
    assert "workspace" in broken and any(what.startswith("speed of joint") for what in broken)
