"""Columns in the wrong order."""

from dataclasses import replace

import numpy as np
import pytest

from acqd.dataset.axis_order import best_of
from acqd.dataset.build import BuildConfig, build
from acqd.dataset.column_check import (
    _require_scale,
    check_columns,
    doubt_robot,
    judge_logs,
    judge_recordings,
    judge_table,
)
from acqd.dataset.merge import Recording
from acqd.dataset.order_fit import CLEARLY, OrderSample
from acqd.dataset.other_robot import other_robot
from acqd.errors import UserError
from acqd.robot.description import load_description
from acqd.robot.inertia import inverse_dynamics
from acqd.robot.log import RobotLog
from acqd.robot.log_reader import read_log
from tests.campaigns import quiet
from tests.places import ROBOT_LOGS, needs_robot_logs


def test_mixed_up_columns_are_named(cell, tmp_path):
    made, *_ = cell
    folder = tmp_path / "logs"
    folder.mkdir()
    for path in sorted((made.out / "logs").rglob("*.log"))[:3]:
        lines = path.read_text().splitlines()
        names = lines[0].split()
        first = next(k for k, name in enumerate(names) if name.startswith("axisQMsr"))
        shift = len(names) - len(lines[1].split())  # the header may begin with a lone %
        swapped = [lines[0]]
        for line in lines[1:]:
            cells = line.split()
            one, other = first + 1 - shift, first + 3 - shift
            cells[one], cells[other] = cells[other], cells[one]
            swapped.append(" ".join(cells))
        (folder / path.name).write_text("\n".join([*swapped, ""]))
    with pytest.raises(UserError, match=r"none of 3 logs can be used; the first: .*columns in the order"):
        build(BuildConfig(f"{made.out}/power.sqlite", folder, tmp_path / "ds", "iiwa7_r800"), quiet)
    assert not (tmp_path / "ds").exists()


ORDERS = [
    ([2, 1, 0, 3, 4, 5], "with shoulder_pan and elbow exchanged"),
    ([0, 2, 1, 3, 4, 5], "with shoulder_lift and elbow exchanged"),
    ([0, 1, 2, 4, 3, 5], "with wrist_1 and wrist_2 exchanged"),
    ([0, 1, 2, 3, 5, 4], "with wrist_2 and wrist_3 exchanged"),
    ([1, 2, 0, 3, 4, 5], "shoulder_pan from column 3, shoulder_lift from column 1, elbow from column 2"),
    ([1, 2, 3, 4, 5, 0], "shoulder_pan from column 6, shoulder_lift from column 1, elbow from column 2"),
    ([1, 0, 2, 4, 3, 5], "shoulder_pan from column 2, shoulder_lift from column 1, wrist_1 from column 5"),
]


@pytest.fixture(scope="module")
def ur10e():
    robot = load_description("ur10e")
    return robot, [read_log(path, robot) for path in sorted((ROBOT_LOGS / "ur10e").glob("ur-20_02*.csv"))[:5]]


@needs_robot_logs
@pytest.mark.parametrize(("order", "remedy"), ORDERS)
def test_columns_in_another_order_are_refused_with_the_order_by_currents(ur10e, order, remedy):
    robot, logs = ur10e
    with pytest.raises(UserError, match=remedy):
        judge_logs([replace(log, q=log.q[:, order], current=log.current[:, order]) for log in logs], robot)


@needs_robot_logs
def test_currents_of_five_logs_confirm_the_order(ur10e):
    robot, logs = ur10e
    assert judge_logs(logs, robot).unsure == frozenset()


def recordings_of(robot, logs, order=range(6), currents=None):
    """Angles in that order, the power of the logs' measured currents, and the currents in an order of their own."""
    gain = np.array([joint.drive.effort_per_ampere for joint in robot.joint])
    recordings = []
    for log in logs:
        grid = np.arange(log.time[0], log.time[-1], 0.04)
        q, qd, current = (
            np.column_stack([np.interp(grid, log.time, column) for column in values.T])
            for values in (log.q, log.qd, log.current)
        )
        columns = {f"q{axis + 1}": q[:, column] for axis, column in enumerate(order)}
        columns["P"] = 36 + (gain * current * qd).sum(axis=1) + (0.7 * current**2).sum(axis=1)
        columns |= {f"current{axis + 1}": current[:, column] for axis, column in enumerate(currents or ())}
        stamps = np.rint(1e9 * grid).astype(np.int64)
        recordings.append(Recording(log.path.stem, stamps, columns, np.ones(len(grid), bool)))
    return recordings


def by_power(robot, logs, order=range(6)):
    """What the power of the logs says of angles in that order."""
    return judge_recordings(recordings_of(robot, logs, order), robot, None)


@needs_robot_logs
def test_recordings_of_a_table_are_judged_as_logs(ur10e):
    robot, logs = ur10e
    order, remedy = ORDERS[3]
    with pytest.raises(UserError, match=f"angles and currents do not fit as logged: ur10e .*{remedy}"):
        judge_table(recordings_of(robot, logs, order, order), robot)
    order, remedy = ORDERS[2]
    with pytest.raises(UserError, match=f"angles and power of 5 recordings do not fit as logged: .*{remedy}"):
        judge_table(recordings_of(robot, logs, order), robot)
    (other,) = recordings_of(robot, logs[:1], range(6), range(6))
    other.columns.update({f"tau{k}": 9 * np.roll(other.columns[f"current{k}"], 300) for k in range(1, 7)})
    with pytest.raises(UserError, match=f"recording {other.name}: the torques do not belong to the angles"):
        judge_table([other], robot)
    assert judge_table(recordings_of(robot, logs, range(6), range(6)), robot) == []


@needs_robot_logs
@pytest.mark.parametrize(("order", "remedy"), [ORDERS[0], ORDERS[2], ORDERS[5]])
def test_columns_in_another_order_are_refused_with_the_order_by_power(ur10e, order, remedy):
    with pytest.raises(UserError, match=remedy):
        by_power(*ur10e, order)


@needs_robot_logs
def test_guessed_bodies_neither_contradict_nor_confirm_columns(ur10e):
    robot, logs = ur10e
    joints = [joint.model_copy(update={"guessed": ["link"]}) for joint in robot.joint]
    for order in (ORDERS[0][0], ORDERS[2][0], range(6)):
        (line,) = by_power(robot.model_copy(update={"joint": joints}), logs, order)
        assert "the order of the joints is not confirmed" in line
    first = [joints[k] if k < 2 else joint for k, joint in enumerate(robot.joint)]
    (line,) = by_power(robot.model_copy(update={"joint": first}), logs)
    assert "shoulder_pan and shoulder_lift" in line
    two = [joints[k] if k in (3, 4) else joint for k, joint in enumerate(robot.joint)]
    with pytest.raises(UserError, match=ORDERS[0][1]):  # those of the others do
        by_power(robot.model_copy(update={"joint": two}), logs, ORDERS[0][0])


@needs_robot_logs
def test_joints_that_the_power_cannot_tell_apart_are_named(ur10e):
    line = "the order of wrist_2 and wrist_3 is not confirmed by these logs (by their power): check the columns"
    assert by_power(*ur10e) == [line]
    assert "wrist_2 and wrist_3 is not confirmed" in by_power(*ur10e, ORDERS[3][0])[0]
    robot, logs = ur10e
    assert by_power(robot, [log.part(np.arange(500), log.path) for log in logs[:1]]) == [
        "the order of the joints is not confirmed by these logs (by their power): check the columns"
    ]


@pytest.mark.slow
@needs_robot_logs
@pytest.mark.parametrize("name", ["ur10e", "kinova_gen3"])
def test_no_real_log_is_refused_for_its_order(name):
    robot = load_description(name)
    for path in sorted((ROBOT_LOGS / name).glob("*.csv"))[4:12]:
        log = read_log(path, robot)
        judge_logs([log], robot)
        check_columns(log, robot)


def test_torques_of_friction_on_a_vertical_axis_are_no_other_unit():
    robot, t = load_description("ur5e"), np.arange(0, 40, 0.04)
    q = np.tile([0, -1.57, 1.57, -1.57, -1.57, 0], (len(t), 1))
    q[:, 0] = 1.2 * np.sin(2 * np.pi * t / 4)
    qd = np.gradient(q, 0.04, axis=0)
    friction = np.array([joint.friction.coulomb for joint in robot.joint])
    tau = inverse_dynamics(robot, q, qd, np.gradient(qd, 0.04, axis=0)) + friction * np.tanh(qd / 0.01)
    _require_scale(robot, [("torques", q, tau)], "x")
    q[:, 1] += 0.5 * np.sin(2 * np.pi * t / 5)
    with pytest.raises(UserError, match="in mNm or per cent"):
        _require_scale(robot, [("torques", q, 1000 * inverse_dynamics(robot, q, 0 * q, 0 * q))], "x")


@needs_robot_logs
def test_logs_of_the_larger_arm_of_a_family_are_doubted_and_those_of_the_right_one_are_not(ur10e):
    robot, logs = ur10e
    assert doubt_robot(logs, robot) == []
    (line,) = doubt_robot(logs, load_description("ur5e"))
    assert "fit ur10e better than ur5e" in line


def test_an_arm_with_its_rated_payload_is_not_taken_for_a_larger_one():
    robot, t = load_description("ur5e"), np.arange(0, 40, 0.08)
    axes = range(robot.axes)
    q = np.column_stack([1.2 * np.sin(2 * np.pi * (0.1 + 0.03 * k) * t + k) + 0.5 * np.sin(k + 1) for k in axes])
    qd = np.gradient(q, 0.08, axis=0)
    last = robot.joint[-1]
    link = last.link.model_copy(update={"mass": last.link.mass + 5.0})
    loaded = robot.model_copy(update={"joint": [*robot.joint[:-1], last.model_copy(update={"link": link})]})
    tau = inverse_dynamics(loaded, q, qd, np.gradient(qd, 0.08, axis=0))
    tau += 0.1 * np.abs(tau).max(axis=0) * np.tanh(qd / 0.02)
    assert other_robot(robot, [OrderSample(q, tau + np.random.default_rng(0).normal(0, 0.2, tau.shape), 0.08)]) == ""


@pytest.mark.parametrize(("name", "axis"), [("ur5e", 2), ("ur5e", 0), ("franka_panda", 3)])
def test_motor_torques_of_one_moving_joint_belong_to_the_angles(tmp_path, name, axis):
    robot = load_description(name)
    time = 0.02 * np.arange(1000)
    q = np.tile(np.array([0, 0.5, 0, -1.5, 0, 1.2, 0.3])[: robot.axes], (1000, 1))
    q[:, axis] += 0.6 * np.sin(0.8 * time) + 0.2 * np.sin(2.3 * time)
    qd = np.gradient(q, time, axis=0)
    rated = np.array([joint.effort for joint in robot.joint])
    tau = inverse_dynamics(robot, q, qd, np.gradient(qd, time, axis=0)) + 0.08 * rated * np.tanh(qd / 0.02)
    tau += 0.02 * rated * np.random.default_rng(1).normal(size=q.shape)
    check_columns(RobotLog(tmp_path / "log.csv", time, q, tau=tau), robot)


def test_the_best_of_many_orders_pays_for_the_choice_and_few_blocks_for_their_scatter():
    """Orders that fit as well as the logged one, by 32 blocks of noise: one in fifty is called better."""
    differences = np.random.default_rng(1).standard_normal((2000, 61, 32))
    errors = differences.sum(axis=2) / (differences.std(axis=2) * np.sqrt(32))
    share = float((errors.max(axis=1) > best_of(61, 32)).mean())
    assert 0.01 < share < 0.03 < float((errors.max(axis=1) > CLEARLY).mean())
    assert best_of(61, 32) > best_of(61, 320) > best_of(1, 320)


@pytest.mark.parametrize(
    ("motion", "noise_W", "doubted"),
    [("all", 10.0, True), ("all", 500.0, False), ("none", 10.0, False), ("vertical", 10.0, False)],
)
def test_power_is_doubted_only_of_motion_that_needs_much_of_it(motion, noise_W, doubted):
    """An arm that stands or turns about a vertical axis moves little power beside fans and a load on the same line."""
    robot, random = load_description("ur10e"), np.random.default_rng(4)
    time = np.arange(0.0, 120.0, 0.04)
    moving = {"all": np.ones(6), "none": np.zeros(6), "vertical": np.eye(6)[0]}[motion]
    q = np.array([0.0, -1.2, 1.0, -0.5, -1.5, 0.0]) + moving * np.sin(time[:, None] * (0.5 + 0.13 * np.arange(6)))
    columns = dict(zip([f"q{axis}" for axis in range(1, 7)], q.T, strict=True))
    columns["P"] = 300.0 + random.normal(0.0, noise_W, len(time))
    recording = Recording("a", (1e9 * time).astype(np.int64), columns, np.ones(len(time), bool))
    assert any("the motion explains" in note for note in judge_recordings([recording], robot, None)) == doubted
