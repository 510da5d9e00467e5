"""A servo with a pendulum whose drive is guessed: measured motion, power derived from duty and voltage."""

import orjson
import pytest

from acqd.discrepancy.config import CloseConfig
from acqd.discrepancy.loop import close_loop
from acqd.models.config import TrainConfig
from acqd.models.training import train_one
from tests.commands import acqd_here, refused
from tools.studies.measured_robots.pendulum import DATA, DESCRIPTION, MOMENT, TRUE_KG_M, dataset, runs

pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason="the recordings of servo_pendulum are not here")


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    folder = tmp_path_factory.mktemp("pendulum")
    for mass in ("0.535", "0.741"):
        dataset(runs(DATA, mass), folder / f"ds{mass}")
    train_one(TrainConfig(folder / "ds0.535", "grey-box", folder / "model", robot=str(DESCRIPTION)), lambda *_: None)
    return folder


def test_a_heavier_bob_is_a_payload_of_the_right_first_moment(trained):
    closed = close_loop(CloseConfig(trained / "ds0.741", trained / "model", trained / "loop"), lambda *_: None)
    [effect] = closed.improved.named
    assert effect.term.id == "payload"
    moment = effect.term.parameters[MOMENT]
    low, high = moment["ci95"]
    assert low < TRUE_KG_M < high
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
