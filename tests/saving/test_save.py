"""`acqd save` as a user runs it."""

import json

import numpy as np
import pytest

from acqd.lab.cell import build_cell
from acqd.lab.settings import LabSettings
from acqd.lab.single_run import _load
from acqd.models.bundle.restore import open_model
from acqd.motion.controller import BrakeSettings, Controller
from acqd.motion.limits import MotionLimits
from acqd.motion.program_file import read_program
from acqd.robot.arm import Arm
from acqd.robot.collision import CollisionChecker
from acqd.robot.log_reader import read_log
from acqd.robot.scene import load_scene
from acqd.saving.power import Meter
from tests.builders import ROBOT
from tests.commands import acqd_here, refused


@pytest.fixture(scope="module", params=["program.toml", "log.csv"])
def said(request, place):
    """JSON of the command, and the folder of its files."""
    out = place / f"{request.param}.out"
    options = ("--longer", "20%", "--payload", "0.5")
    done = acqd_here("save", place / "model", place / request.param, "--out", out, *options, "--json")
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout), out


def by_name(block):
    return {each["name"]: each for each in block["proposals"]}


def test_the_best_saves_at_equal_cycle_time_and_more_than_plain_slowing(said):
    told, _ = said
    equal, other = by_name(told["equal"]), by_name(told["other"])
    best = equal["best together"]
    assert best["verdict"] == "saves"
    assert best["saving_J"] == pytest.approx(max(each["saving_J"] for each in equal.values()))
    assert best["saving_J"] > equal["plain slowing into the waits"]["saving_J"] + 1
    assert other["best together"]["saving_J"] > other["plain uniform slowing"]["saving_J"] + 1
    for block in (told["equal"], told["other"]):
        for each in block["proposals"]:
            assert each["seconds"] == pytest.approx(block["seconds"], abs=0.02), each["name"]
            assert sum(each["causes_J"].values()) == pytest.approx(each["energy_J"])
            low, high = each["interval_J"]
            assert low <= each["saving_J"] <= high
            assert (each["verdict"] == "unprovable") == (low <= 0 <= high)
    assert told["equal"]["instead"]["name"] == "as it is"
    log = told["work"].endswith(".csv")  # without the signal of the tool
    assert any("which pauses the process needs" in text for text in told["cannot_tell"]) == log
    assert told["other"]["instead"]["energy_J"] > told["equal"]["instead"]["energy_J"]
    assert told["what_if"][0]["saving_J"] < 0  # half a kilogram more


def test_what_is_written_keeps_path_and_limits_and_uses_what_was_said(said, place, program):
    told, out = said
    _, model = open_model(place / "model")
    arm = Arm(ROBOT)
    limits = MotionLimits(arm, CollisionChecker(arm, load_scene("free")), ROBOT.speed, ROBOT.acceleration)
    old = program.motion(ROBOT).q
    for name in ("equal", "other"):
        log = read_log(out / name / "motion.csv", ROBOT)
        far = np.abs(log.q[::5, None] - old[None, ::5]).max(axis=2).min(axis=1)
        assert far.max() < (0.005 if told["work"].endswith(".csv") else 0.03), name  # a blended corner may be sharper
        assert np.abs(log.q[-1] - old[-1]).max() < 1e-3
        best = by_name(told[name])["best together"]
        if (out / name / "program.toml").exists():
            after = BrakeSettings(close_after_s=2.0)
            again = read_program(out / name / "program.toml", ROBOT)
            motion = Controller(ROBOT, again.start, after).run(list(again.steps))
            assert limits.broken(motion) is None
            assert Meter(model, "").use(motion).energy == pytest.approx(best["energy_J"], rel=2e-3)
            assert "movej" in (out / name / "program.script").read_text()
        else:
            assert "servoj" in (out / name / "program.script").read_text()
        assert "person has to check" in (out / name / "program.script").read_text()
    page = (out / "save.html").read_text()
    assert "simulated" in page and "<script src" not in page


def test_the_laboratory_executes_a_program_file(place, program):
    cell = build_cell(LabSettings(robot="ur10e"))
    task = _load(cell, place / "program.toml")
    assert np.allclose(task.motion(Controller(ROBOT, task.start)).q, program.motion(ROBOT).q, atol=1e-6)


@pytest.mark.parametrize(
    ("work", "options", "message"),
    [
        ("log.csv", ("--robot", "ur3e"), "is a model of ur10e, not of ur3e"),
        ("still.csv", (), "the arm does not move"),
        ("short.toml", ("--longer", "0.5s"), "cannot be reached: within the limits the shortest is"),
        ("log.csv", ("--longer", "much"), "expected percent"),
        ("log.csv", ("--workspace", "0", "0", "0", "0.1", "0.1", "0.1"), "(workspace)"),
        ("log.csv", ("--limit-speed", "5"), "(speed of"),
        ("far.toml", (), "step 1: elbow = 200 deg is outside -180 .. 180 deg"),
        ("itself.toml", (), "(collision)"),
        ("other.toml", (), "is a program of ur3e, not of ur10e"),
        ("empty.toml", (), "a step has either to, or wait"),
        ("absent.csv", (), "no such file"),
        ("log.csv", ("--free-order",), "--free-order needs a program file"),
        ("program.toml", ("--free-order",), "switches the tool"),
    ],
)
def test_bad_input_is_refused_in_one_line(work, options, message, place):
    far = 'robot = "ur10e"\nstart = [0, -80, 80, -90, -90, 0]\n[[step]]\nto = [0, -80, 200, -90, -90, 0]\n'
    texts = {
        "far.toml": far, "itself.toml": far.replace("200", "175"), "other.toml": far.replace("ur10e", "ur3e"),
        "short.toml": far.replace("200", "90"), "empty.toml": far.partition("to =")[0],
        "still.csv": "time,q1,q2,q3,q4,q5,q6\n" + "".join(f"{k / 25},0,-1,1,0,0,0\n" for k in range(100)),
    }  # fmt: skip
    for name, text in texts.items():
        (place / name).write_text(text)
    before = {path.name for path in place.iterdir()}
    assert message in refused(acqd_here("save", place / "model", place / work, *options))
    assert {path.name for path in place.iterdir()} == before
