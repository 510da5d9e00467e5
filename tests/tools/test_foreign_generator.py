"""The generator of foreign plants: its physics, and that it has nothing of acqd."""

import ast
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.places import ROOT
from tools.studies.foreign import cases as study
from tools.studies.foreign.generator.arm import described, point_mass, true_arm
from tools.studies.foreign.generator.dosing import acting_rms, dosed, within
from tools.studies.foreign.generator.dynamics import GRAVITY, energy, force_torques, joint_torques, posture
from tools.studies.foreign.generator.hidden.catalogue import ALL
from tools.studies.foreign.generator.hidden.effect import Dose
from tools.studies.foreign.generator.motion import STEP_S, Plan, given, session
from tools.studies.foreign.generator.plant import Plant, Session, flow
from tools.studies.foreign.generator.recordings import Clock, write

GENERATOR = ROOT / "tools" / "studies" / "foreign" / "generator"
ROBOTS = ("iiwa7_r800", "ur10e")


def imports_of(path: Path) -> set[str]:
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            found.add(node.module or "")
    return found


def test_no_module_of_the_generator_imports_acqd():
    paths = list(GENERATOR.rglob("*.py"))
    assert len(paths) > 10
    for path in paths:
        named = imports_of(path)
        assert not {name for name in named if name.split(".")[0] == "acqd"}, path
        # and nothing through another tool
        tools = {name for name in named if name.startswith("tools")}
        assert all(name.startswith("tools.studies.foreign.generator") for name in tools), path


def test_the_running_generator_has_loaded_nothing_of_acqd():
    code = "import sys, tools.studies.foreign.generator.recordings, tools.studies.foreign.generator.dosing;"
    code += "sys.exit(any(name.split('.')[0] == 'acqd' for name in sys.modules))"
    assert subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=False).returncode == 0


@pytest.mark.parametrize("robot", ROBOTS)
def test_the_joints_power_is_the_change_of_the_bodies_energy(robot):
    arm = true_arm(described(robot), np.random.default_rng(3))
    motion = session(arm, Plan(1, 20.0), np.random.default_rng(4))
    tau = joint_torques(arm, arm.bodies, motion.q, motion.qd, motion.qdd)
    power = (tau * motion.qd).sum(axis=1)
    work = np.concatenate([[0.0], np.cumsum((power[1:] + power[:-1]) / 2) * STEP_S])
    stored = energy(arm, arm.bodies, motion.q, motion.qd)
    assert np.ptp(stored) > 20.0
    assert np.abs(work - (stored - stored[0])).max() < 2e-3 * np.ptp(stored)


@pytest.mark.parametrize("robot", ROBOTS)
def test_speeds_and_accelerations_are_derivatives_of_the_angles(robot):
    motion = session(described(robot), Plan(2, 30.0), np.random.default_rng(5))
    assert np.allclose(np.gradient(motion.q, STEP_S, axis=0)[2:-2], motion.qd[2:-2], atol=0.02)
    middle = np.gradient(motion.qd, STEP_S, axis=0)
    assert np.percentile(np.abs(middle - motion.qdd), 99) < 0.1
    assert np.abs(motion.qd).max(axis=0).min() > 0.3


def test_a_held_weight_is_a_force_on_the_flange():
    arm = described("iiwa7_r800")
    q = np.random.default_rng(6).uniform(-1, 1, (20, 7))
    still = np.zeros_like(q)
    by_mass = joint_torques(arm, [point_mass(6, arm.flange)], q, still, still)
    by_force = force_torques(arm, q, arm.flange, np.tile(GRAVITY, (20, 1)))
    assert np.allclose(by_mass, by_force, atol=1e-9)


def test_frames_agree_with_pinocchio():
    pinocchio = pytest.importorskip("pinocchio")
    arm = described("ur10e")
    model = pinocchio.Model()
    for k in range(6):
        joint = pinocchio.JointModelRevoluteUnaligned(arm.axis[k])
        model.addJoint(k, joint, pinocchio.SE3(arm.turn[k], arm.offset[k]), f"j{k}")
        body = arm.bodies[k]
        model.appendBodyToJoint(k + 1, pinocchio.Inertia(body.mass, body.centre, body.tensor), pinocchio.SE3.Identity())
    random = np.random.default_rng(7)
    q, qd, qdd = random.normal(0, 1, (3, 5, 6))
    data = model.createData()
    expected = np.array([pinocchio.rnea(model, data, *row) for row in zip(q, qd, qdd, strict=True)])
    assert np.allclose(joint_torques(arm, arm.bodies, q, qd, qdd), expected, rtol=1e-6, atol=1e-6)
    pinocchio.forwardKinematics(model, data, q[-1])
    assert np.allclose(posture(arm, q).origin[5][-1], data.oMi[6].translation, atol=1e-9)


@pytest.fixture(scope="module")
def short():
    plant = Plant.drawn("iiwa7_r800", 1, signals=True)
    return Session.drawn(plant, Plan(2, 30.0), np.random.default_rng(8))


@pytest.mark.parametrize("name", sorted(ALL))
def test_every_effect_reaches_a_strength_and_acts_within_recordings(short, name):
    dose, reached = dosed(short, ALL[name](short, np.random.default_rng(9)), 0.03)
    hidden = (flow(short, [dose]).power - flow(short, []).power)[within(short)]
    assert acting_rms(hidden) > 0.2
    assert reached == pytest.approx(0.03, rel=0.1) or dose.size == dose.effect.most


def test_the_true_arm_differs_from_the_described_one_by_10_to_20_percent():
    arm = described("ur10e")
    ratios = [
        true.mass / body.mass
        for true, body in zip(true_arm(arm, np.random.default_rng(1)).bodies, arm.bodies, strict=True)
    ]
    assert all(0.099 < abs(ratio - 1) < 0.201 for ratio in ratios)


def test_friction_never_drives_the_arm(short):
    assert (short.friction * short.motion.qd).min() >= 0.0


def test_files_are_those_of_a_plant(short, tmp_path):
    none = Dose(ALL["payload"](short, np.random.default_rng(1)), 0.0)
    random = np.random.default_rng(2)
    write(short, [none], tmp_path / "s", 1.7676e9, Clock(0.5, 20.0), torques=True, random=random)
    logs = sorted((tmp_path / "s" / "logs").iterdir())
    assert [log.name for log in logs] == ["cycle-aa.csv", "cycle-ab.csv"]
    header = logs[0].read_text().splitlines()[0].replace('"', "").split(",")
    assert header[:8] == ["time", *(f"q{k}" for k in range(1, 8))]
    assert header[-2:] == ["brake", "tool"] and "tau7" in header and "current1" in header
    rows = np.loadtxt(logs[0], delimiter=",", skiprows=1)
    assert rows[0, 0] - 1.7676e9 - 0.5 == pytest.approx(short.motion.t[short.motion.recordings[0].start], abs=0.01)
    assert (tmp_path / "s" / "power.csv").read_text().startswith('"time","P","Vrms"')


def test_a_harsh_site_differs_on_both_sides_and_between_them():
    sites = [Plant.drawn("ur10e", seed, signals=False, harsh=True).site for seed in range(40)]
    for name in ("compressor_W", "gripper_kg", "mixed_friction", "delay_s", "capacitor", "step_W", "holes"):
        assert 0 < sum(bool(getattr(site, name)) for site in sites) < 40, name
    plan = Plan(2, 30.0)
    for site in sites:
        assert site.plan(plan, after=True).override != site.plan(plan, after=False).override
    loud = next(site for site in sites if site.compressor_W)
    load = loud.load(400_000, np.random.default_rng(1))
    assert set(np.unique(load)) == {0.0, loud.compressor_W}
    coarse = next(site for site in sites if site.step_W)
    read = coarse.read(np.linspace(90, 110, 500), np.random.default_rng(2)) / coarse.step_W
    assert np.allclose(read, np.round(read))


def test_a_second_session_has_the_same_effect_in_a_motion_that_is_given(tmp_path, monkeypatch):
    monkeypatch.setitem(study.PLANS, "short", (Plan(1, 20.0), Plan(1, 20.0)))
    world = study.World(6, 3, "short", torques=False, own_clocks=False)
    case = study.Case("payload-10", ("payload",), 10)
    truth = study.make_after(world, case, tmp_path / "first")
    planned = session(described("ur10e"), Plan(1, 15.0), np.random.default_rng(8))
    rows = planned.recordings[0]
    motion = given(planned.q[rows], planned.qd[rows], planned.qdd[rows])
    recorded = motion.recordings[0]
    assert np.array_equal(motion.q[recorded][600:-600], planned.q[rows])  # between two rests of 3 s
    seen = []
    monkeypatch.setattr(study, "_write", lambda world, session, doses, *_: seen.append((session, doses)))
    study.make_second(world, case, tmp_path / "second", truth, "designed", motion)
    (second, (dose,)), (known,) = seen[0], truth["effects"]
    assert dose.size == known["size"] and dose.effect.details == known["details"]
    assert len(second.motion.t) == len(motion.t) == len(dose.effect.torque)
