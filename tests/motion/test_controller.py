"""The controller: brakes, tool and phases."""

import numpy as np
import pytest

from acqd.motion.chain import Move
from acqd.motion.controller import RATE, Controller, Phase, SwitchTool, Wait
from tests.lab.moved import IIWA


def test_the_brakes_open_before_motion_and_close_after_standstill():
    target = np.full(7, 0.2)
    motion = Controller(IIWA, np.zeros(7)).run([Wait(1.0), Move(target, 0.3, 0.2), Wait(14.0), Move(-target, 0.3, 0.2)])
    opened = np.flatnonzero(np.diff(motion.brake_open.astype(int)) == 1) + 1
    closed = np.flatnonzero(np.diff(motion.brake_open.astype(int)) == -1) + 1
    moving = np.flatnonzero(np.abs(motion.qd).max(axis=1) > 0)
    assert len(opened) == 2 and len(closed) == 1
    assert opened[0] == 1000 and moving[0] - opened[0] == pytest.approx(250, abs=2)
    rests = moving[np.argmax(np.diff(moving))]
    assert closed[0] - rests == pytest.approx(10_000, abs=3)
    assert motion.brake_open[moving].all()


def test_tool_and_phases_follow_the_program():
    program = [Phase("pick"), Move(np.full(7, 0.1), 0.3, 0.2), SwitchTool(True), Phase("carry"), Wait(0.5)]
    program += [SwitchTool(False), Wait(0.2)]
    motion = Controller(IIWA, np.zeros(7)).run(program)
    names = [motion.phase[k] for k in motion.phase_number]
    assert set(names) == {"pick", "carry"}
    assert motion.tool_on.sum() == pytest.approx(0.9 * RATE, abs=2)
    assert not motion.tool_on[-1]
