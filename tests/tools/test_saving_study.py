"""The study of `acqd save`: what it executes is what was written, and its figures count what they say."""

import numpy as np
import pytest

from acqd.motion.program_text import timed_joints
from acqd.motion.replayed_log import motion_of
from acqd.robot.description import load_description
from acqd.robot.log_reader import read_log
from tools.studies.foreign.cases import World
from tools.studies.foreign.generator.dynamics import joint_torques
from tools.studies.saving.__main__ import summary
from tools.studies.saving.execution import energy, greatest, replayed, violations, write_log
from tools.studies.saving.metered import metered, torques
from tools.studies.saving.programs import pick_and_place


def test_a_log_that_is_replayed_uses_what_the_program_used(tmp_path):
    robot, plant = load_description("ur10e"), World(6, 5, "short", torques=False, own_clocks=False).plant()
    random = np.random.default_rng(2)
    program = pick_and_place(robot, 6.0, random)
    write_log(tmp_path / "log.csv", program, plant.signals, random)
    again = replayed(timed_joints(motion_of(read_log(tmp_path / "log.csv", robot), robot)), len(program.q))
    assert np.abs(again.q - program.q).max() < 2e-3
    own = greatest(plant, program)
    assert violations(plant, again, own) == []
    still = np.ones(len(program.q))
    assert energy(plant, again, still) == pytest.approx(energy(plant, program, still), rel=1e-3)
    assert "speed" in violations(plant, type(program)(again.q, 9 * again.qd, again.qdd), own)


@pytest.mark.parametrize(("robot", "axes"), [("ur10e", 6), ("fr3", 7)])
def test_mujoco_and_the_daemon_count_what_the_plant_uses(robot, axes):
    plant = World(axes, 5, "short", torques=False, own_clocks=False, arm=robot).plant()
    program = pick_and_place(load_description(robot), 2.0, np.random.default_rng(2))
    own = joint_torques(plant.arm, plant.arm.bodies, program.q, program.qd, program.qdd)
    assert torques(plant.arm, program) == pytest.approx(own, abs=1e-9) and np.abs(own).max() > 10
    still = np.ones(len(program.q))
    counted = metered(plant, program, still, np.random.default_rng(3))
    assert counted == pytest.approx(energy(plant, program, still), rel=2e-3)


def test_figures_count_proposals():
    line = {
        "plant": "a", "program": 0, "block": "equal", "name": "best together", "before_J": 100.0, "predicted_J": 3.0,
        "half_J": 1.0, "measured_J": 2.5, "verdict": "saves", "violations": [], "again": False, "metered_J": None,
    }  # fmt: skip
    worse = line | {"program": 1, "measured_J": -1.0, "violations": ["jerk"]}
    figures = summary([line, worse, line | {"half_J": None, "name": "other"}, line | {"again": True, "name": "also"}])
    counted = summary([line | {"metered_J": 3.9}, worse | {"metered_J": 4.1}, line | {"again": True, "metered_J": 3.9}])
    assert (counted["metered_within_interval"], counted["metered"]) == (1, 2)
    assert (figures["programs"], figures["proposals"], figures["within_interval"]) == (2, 2, 1)
    assert (figures["said_to_save"], figures["of_these_worse"], figures["limits_violated"]) == (2, 1, 1)
    assert figures["median_saving"]["equal, best"] == pytest.approx(0.0075)


def test_proposals_of_one_plant_count_as_alike_and_make_the_coverage_less_sure():
    line = {
        "program": 0, "block": "equal", "name": "speeds", "before_J": 9.0, "predicted_J": 2.0, "half_J": 1.0,
        "verdict": "saves", "violations": [], "again": False, "metered_J": None,
    }  # fmt: skip
    errors = {"a": (0.2, 0.3, 0.25), "b": (-0.4, -0.5, -0.45), "c": (1.4, 1.2, 1.3)}
    figures = summary([line | {"plant": p, "measured_J": 2.0 + e} for p, some in errors.items() for e in some])
    assert figures["coverage"] == pytest.approx(2 / 3) and figures["one_plant_correlation"] > 0.9
    assert figures["coverage_error"] == pytest.approx(1 / 3)  # of three plants one, not of nine proposals
