"""A grey box of a UR10e with held-out recordings, a small program, and the log of its motion."""

from dataclasses import replace

import numpy as np
import pytest

from acqd.models.bundle.bundle import save_bundle
from acqd.models.bundle.envelope import Envelope
from acqd.models.bundle.reference import reference_arrays
from acqd.motion.chain import Move
from acqd.motion.controller import SwitchTool, Wait
from acqd.motion.program_file import Program, program_text
from acqd.motion.program_text import timed_joints
from tests.builders import ROBOT, STEP, grey_bundle, recording

HOME = np.radians([0.0, -80.0, 80.0, -90.0, -90.0, 0.0])
THERE = np.radians([50.0, -60.0, 100.0, -120.0, -90.0, 30.0])
BACK = np.radians([20.0, -70.0, 95.0, -110.0, -90.0, 10.0])


@pytest.fixture(scope="session")
def program():
    """Two motions, a long wait, a tool that switches, and the way home with a blended corner."""
    return Program(
        HOME,
        (
            Wait(0.5), Move(THERE, 0.4, 0.3), Wait(4.0), SwitchTool(True, 0.5), Move(BACK, 0.3, 0.3, 0.7),
            Move(HOME, 0.4, 0.3), Wait(0.5),
        ),
    )  # fmt: skip


@pytest.fixture(scope="session")
def place(model, program, tmp_path_factory):
    """A folder with the model, program.toml and log.csv."""
    folder = tmp_path_factory.mktemp("saving")
    held_out = [replace(recording(model, number, rows=700), split="test") for number in range(6)]
    envelope = Envelope(np.full((3, 6), -9.0), np.full((3, 6), 9.0)).as_json()
    save_bundle(folder / "model", grey_bundle(reference_arrays(held_out), envelope=envelope, measured="simulated"))
    (folder / "program.toml").write_text(program_text(program, ROBOT, "a test"))
    (folder / "log.csv").write_text(timed_joints(program.motion(ROBOT)))
    assert model.step_s == STEP
    return folder
