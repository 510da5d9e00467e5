"""A servo with a pendulum whose drive is guessed: measured motion, power derived from duty and voltage."""

from pathlib import Path

import numpy as np
import orjson
import pytest
from scipy.signal import medfilt, savgol_filter

from acqd.dataset.build import build
from acqd.dataset.config import BuildConfig
from acqd.discrepancy.config import CloseConfig
from acqd.discrepancy.loop import close_loop
from tests.commands import acqd_here, refused

MEASURED = Path(__file__).parents[3] / "shared" / "data" / "robots" / "servo_pendulum"
LAG_S = 0.024
"""Positions are as much older than the duty: `dataset build` finds it where power and motion are separate files."""
KT_NM_A, R_OHM = 1.9, 3.4
ARM = """
name = "pendulum"
title = "servo with 0.535 kg at 0.1 m"
sources = ["mass and arm: weighed and measured; drive: guessed"]
mass_deviation = 0.05
base = { mass = 1.0 }
flange = { xyz = [0.0, 0.0, -0.1], rpy_deg = [180.0, 0.0, 0.0] }
[[joint]]
name = "joint1"
xyz = [0.0, 0.0, 0.3]
axis = [1.0, 0.0, 0.0]
limits_deg = [-180.0, 180.0]
speed_deg_s = 400.0
acceleration_deg_s2 = 4000.0
torque_Nm = 2.9
drive = { gear_ratio = 345.0, rotor_inertia_kgm2 = 0.028, torque_constant_Nm_A = 0.0055, resistance_Ohm = 3.4 }
link = { mass = 0.535, com = [0.0, 0.0, -0.1], inertia = [0.0005, 0.0005, 0.0003, 0.0, 0.0, 0.0] }
guessed = ["drive"]
"""
pytestmark = pytest.mark.skipif(not MEASURED.is_dir(), reason="the recordings of servo_pendulum are not here")


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    from acqd.models.config import TrainConfig
    from acqd.models.training import train_one

    folder = tmp_path_factory.mktemp("pendulum")
    (folder / "arm.toml").write_text(ARM)
    for mass in ("0.535", "0.741"):
        (folder / mass).mkdir()
        for number, file in enumerate(sorted((MEASURED / f"mass_{mass}kg").glob("*.csv"))):
            _log(file, folder / mass / file.name, 1.6e9 + 20 * number)
        build(
            BuildConfig(
                "log", folder / mass, folder / f"ds{mass}", robot=str(folder / "arm.toml"), lag_s=LAG_S
            ),
            lambda *_: None,
        )  # fmt: skip
    robot = str(folder / "arm.toml")
    train_one(TrainConfig(folder / "ds0.535", "grey-box", folder / "model", robot=robot), lambda *_: None)
    return folder


def _log(file, to, start_s):
    t, q, duty, voltage, _ = np.genfromtxt(file, delimiter=",", skip_header=1).T
    good = np.abs(q - medfilt(q, 5)) < 0.3
    t, q, volts = t[good], q[good], (duty * voltage)[good]
    grid = np.arange(t[0], t[-1], 0.01)
    speed = np.interp(t, grid, savgol_filter(np.interp(grid, t, q), 11, 2, deriv=1, delta=0.01))
    P = volts * (volts - KT_NM_A * speed) / R_OHM
    np.savetxt(to, np.column_stack([t + start_s, q, P]), fmt="%.5f", delimiter=",", header="time,q1,power", comments="")


def test_a_heavier_bob_is_a_payload_of_the_right_first_moment(trained):
    closed = close_loop(CloseConfig(trained / "ds0.741", trained / "model", trained / "loop"), lambda *_: None)
    [effect] = closed.improved.named
    assert effect.term.id == "payload"
    moment = effect.term.parameters["first moment about the last axis"]
    low, high = moment["ci95"]
    assert low < 0.0206 < high
    assert (high - low) / 2 < 0.35 * moment["value"]
    assert any("acqd robot calibrate" in note for note in closed.notes)


def test_a_known_mass_at_a_known_place_calibrates_the_drives(trained):
    words = ("robot", "calibrate", trained / "ds0.741", "--model", trained / "model", "--known-mass", 0.206)
    done = acqd_here(*words, "--centre", 0, "--out", trained / "calibrated", "--json", cwd=trained)
    scale = orjson.loads(done.stdout)["torque_scale"]
    low, high = scale["ci95"]
    assert low < 1.0 < high and high - low < 0.7 * scale["value"]


def test_a_mass_that_shows_less_than_guessed_drives_tell_is_refused(trained):
    words = ("robot", "calibrate", trained / "ds0.741", "--model", trained / "model", "--out", trained / "copy")
    assert "--known-mass 0: expected" in refused(acqd_here(*words, "--known-mass", 0, cwd=trained))
    said = refused(acqd_here(*words, "--known-mass", 0.206, cwd=trained))
    assert "which is too uncertain; record more motion, and a larger mass, or say with --centre" in said
    assert not (trained / "copy").exists()
