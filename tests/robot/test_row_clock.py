"""Stamps of rows that are not those of their poses: late, in packets, of a clock that was set, of two recorders."""

import itertools

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from acqd.dataset.log_check import check_log
from acqd.errors import InputError
from acqd.robot.clock_fault import clock_fault
from acqd.robot.description import load_description
from acqd.robot.doubtful_rows import doubtful_rows
from acqd.robot.joint_refresh import between_refreshes, frozen
from acqd.robot.log_reader import log_of, read_log
from acqd.robot.resolution import steps_of
from acqd.robot.row_clock import even_times, late_stamps
from acqd.robot.table import Table
from tests.places import ROBOT_LOGS

ROBOT = load_description("ur10e")
RECORDING = ROBOT_LOGS / "ur10e" / "ur-20_02_06-20sec_5harm.csv"
FINE = np.zeros(6)


@pytest.fixture(scope="module")
def real():
    """Times and angles of a real UR10e."""
    if not RECORDING.exists():
        pytest.skip("no recordings of robots beside this checkout")
    log = read_log(RECORDING, ROBOT)
    return log.time - log.time[0], log.q


def log_with(time, q, **others):
    columns = {"time": time} | {f"q{k + 1}": q[:, k] for k in range(6)} | others
    values = np.column_stack(list(columns.values()))
    return log_of(RECORDING, Table(list(columns), values, np.arange(2, len(values) + 2)), ROBOT)


def jitter(t):
    rng = np.random.default_rng(1)
    return np.maximum.accumulate(t + rng.exponential(0.015, len(t))) + 1e-6 * np.arange(len(t))


def packets(t):
    rows = np.arange(len(t))
    return t[np.minimum(rows // 10 * 10 + 9, len(t) - 1)] + 1e-4 * (rows % 10)


def pose_error(times, poses, t, q):
    """RMS distance of poses from those that a motion has at their times."""
    return np.sqrt(np.mean((np.column_stack([np.interp(times, t, angle) for angle in q.T]) - poses) ** 2))


@pytest.mark.parametrize("stamped", [jitter, packets])
def test_rows_that_were_stamped_when_they_came_are_put_at_the_controllers_rate(real, stamped):
    t, q = real
    log = log_with(1000.0 + stamped(t), q)
    shifts = np.arange(-0.06, 0.061, 0.003)
    off = [pose_error(log.time - 1000.0 - shift, log.q, t, q) for shift in shifts]
    assert min(off) < 0.003  # rad; as stamped: 0.01
    assert abs(shifts[np.argmin(off)]) < log.quality.age_error_s + 0.003
    assert len(log.time) > 0.98 * len(t)
    assert "they are of the recorder" in log.quality.sentences()[0]
    assert log.quality.as_json()["late_stamps_ms"] > 30


@pytest.mark.parametrize(("share", "most_s"), [(0.02, 0.03), (0.005, 0.08)])
def test_rows_behind_a_late_one_are_put_right_and_the_others_keep_their_times(real, share, most_s):
    t, q = real
    random, stamps = np.random.default_rng(6), t.copy()
    for row in np.flatnonzero(random.random(len(t)) < share):  # those that waited come at once
        queue = slice(row, row + 14)
        stamps[queue] = np.maximum(
            stamps[queue], t[row] + random.uniform(0.01, most_s) + 2e-4 * np.arange(len(t[queue]))
        )
    found = late_stamps(np.maximum.accumulate(stamps), q, ROBOT.speed, FINE)
    moves = np.linalg.norm(np.gradient(q, t, axis=0) / ROBOT.speed, axis=1) > 0.05
    late = stamps - t > 0.01
    assert found.few and np.sqrt(np.mean((found.time - t)[moves & late] ** 2)) < 0.006
    assert np.median(np.abs(found.time - t)[~late]) < 1e-5
    assert "were put at even distances from the others" in found.sentence()
    log = log_with(1000 + np.maximum.accumulate(stamps), q)
    assert not log.quality.times_put_right and log.quality.bad_share < 0.03


def test_a_pose_of_another_time_is_no_missing_row(real):
    t, q = real
    first = np.flatnonzero(np.random.default_rng(4).random(len(t) - 1) < 0.01)
    order = np.arange(len(t))
    order[first], order[first + 1] = first + 1, first
    assert clock_fault(t, q[order], ROBOT.speed, FINE) is None


def test_uneven_times_that_are_the_controllers_own_are_kept(real):
    t, q = real
    assert late_stamps(t, q, ROBOT.speed, FINE) is None
    keep = np.sort(np.random.default_rng(2).permutation(len(t))[: int(0.9 * len(t))])
    assert late_stamps(t[keep], q[keep], ROBOT.speed, FINE) is None
    assert clock_fault(t[keep], q[keep], ROBOT.speed, FINE) is None


def test_poses_that_a_faster_recorder_holds_get_the_rate_of_the_controller(real):
    t, q = real
    held = np.column_stack([np.interp(np.floor(t * 30) / 30, t, angle) for angle in q.T])
    log = log_with(t, held)
    expected = np.column_stack([np.interp(log.time, t, angle) for angle in q.T])
    moving = np.abs(np.gradient(expected, log.time, axis=0)).max(axis=1) > 0.3
    off = (log.q - expected)[moving] / np.gradient(expected, log.time, axis=0)[moving]
    fast = np.abs(np.gradient(expected, log.time, axis=0)[moving]) > 0.3
    assert abs(np.median(off[fast])) < log.quality.age_error_s + 0.005
    assert np.std(off[fast]) < 0.005


@pytest.mark.parametrize("pose_s", [0.008, 0.012])
def test_a_controller_of_another_rate_than_the_recorder_is_known_by_the_beat(real, pose_s):
    t, q = real
    rows = np.arange(0, t[-1], 0.01)
    log = log_with(rows, CubicSpline(t, q)(np.floor(rows / pose_s) * pose_s))
    assert pose_error(log.time, log.q, t, q) < 0.002
    assert log.quality.age_error_s < 0.006 and log.quality.fault is None and log.quality.smoothing is None


def set_once(t, q):
    return t + 0.25 * (t > 10), q


def counted(t, q):
    keep = np.random.default_rng(3).random(len(t)) > 0.03
    even = np.arange(0, t[-1], 0.01)[: len(t)]
    q = np.column_stack([np.interp(even, t, angle) for angle in q.T])[keep[: len(even)]]
    return 0.01 * np.arange(len(q)), q


def two_recorders(t, q):
    other = t + 0.0503
    times, rows = np.concatenate([t[::2], other[1::2]]), np.concatenate([q[::2], q[1::2]])
    order = np.argsort(times)
    return times[order], rows[order]


@pytest.mark.parametrize(
    ("fault", "line"),
    [
        (two_recorders, "to and fro from row to row"),
    ],
)
def test_times_that_cannot_be_those_of_the_poses_are_refused_with_the_reason(real, fault, line):
    with pytest.raises(InputError, match=line):
        log_with(*fault(*real))


def test_times_that_count_rows_are_doubted_and_widen_the_interval(real):
    said = log_with(*counted(*real)).quality.sentences()
    assert any("the arm goes as far as in two: if the times count rows, rows are missing" in line for line in said)


def test_a_clock_that_was_set_is_said_once_and_not_refused(real):
    log = log_with(*set_once(*real))
    assert log.quality.sentences()[0].startswith("row 9")
    assert "goes on by 0.26 s while the arm moves as in one row: if the clock was set" in log.quality.sentences()[0]


def test_poses_that_are_sent_again_while_the_arm_moves_are_left_out(real):
    t, q = real
    rows = np.arange(len(t))
    for begin in np.random.default_rng(4).integers(600, len(t) - 600, 10):
        rows[begin : begin + 5] = begin - 1 - np.arange(5) % 2
    log = log_with(t, q[rows])
    assert pose_error(log.time, log.q, t, q) < 0.0005
    assert log.quality.old > 20


def test_a_recorder_that_froze_for_half_a_second_is_no_jump(real):
    t, q = real
    rows = np.arange(len(t))
    rows[1000:1050] = 1000
    log = log_with(t, q[rows])
    assert len(t) - 52 <= len(log.time) <= len(t) - 45


def test_rows_out_of_order_are_sorted(real):
    t, q = real
    mixed = np.random.default_rng(5).permutation(len(t))
    log = log_with(t[mixed], q[mixed])
    assert len(log.time) == len(t)


@pytest.mark.parametrize("late_s", [0.03, 0.05])
def test_single_stamps_beyond_the_next_ones_are_no_second_recording(real, late_s):
    curve, t = CubicSpline(*real), np.arange(0.0, 20.0, 0.01)
    stamps = t.copy()
    stamps[500::200] += late_s
    log = log_with(stamps, curve(t))
    wrong = (np.abs(log.q - curve(log.time)) > 1e-3).any(axis=1)
    assert wrong.sum() <= len(stamps[500::200]) / 4  # where the arm turns, a pose has no age


def test_speeds_in_degrees_and_temperatures_in_kelvin_are_left_out_with_the_reason(real):
    t, q = real
    speeds = np.degrees(np.gradient(q, t, axis=0))
    others = {f"qd{k + 1}": speeds[:, k] for k in range(6)} | {f"temperature{k + 1}": 305 + t for k in range(6)}
    log = log_with(t, q, **others)
    assert log.qd is None and log.temperature is None
    assert [text.split(": ")[0] for text in log.quality.unusable] == [
        "the speed of shoulder_pan is 57.3 times the slope of its angle, in deg/s?",
        "temperatures of 321 are not degC",
    ]


def test_even_times_keep_pauses():
    t = np.concatenate([np.arange(500) * 0.01, 60 + np.arange(500) * 0.01])
    even = even_times(t + np.random.default_rng(6).exponential(0.003, len(t)))
    assert np.abs(even.time - t).max() < 0.006
    assert even.row_s == pytest.approx(0.01, rel=0.01)


def stops_and_goes(row_s, move_s=0.5, rest_s=0.3, start_s=0.1):
    """Times and angles of an arm that goes from point to point and rests exactly; its stamps are true."""
    rng, pose, parts, now = np.random.default_rng(3), np.zeros(6), [], 0.0
    while now < 60:
        way_s = rng.uniform(0.5, 1.5) * move_s
        since = np.arange(int(way_s / row_s)) * row_s
        way = np.cumsum(np.clip(np.minimum(since, way_s - since) / start_s, 0, 1))
        goal = rng.uniform(-0.8, 0.8, 6)
        parts += [pose + (way / way[-1])[:, None] * (goal - pose)]
        pose = goal
        parts += [np.repeat(pose[None], int(rng.uniform(0.5, 1.5) * rest_s / row_s), axis=0)]
        now += way_s + rest_s
    q = np.concatenate(parts)
    return np.arange(len(q)) * row_s, np.round(q, 5)


def path_of(t):
    return np.round(0.6 * np.sin(2 * np.pi * t[:, None] * np.array([1, 2, 3, 1, 2, 3]) / 6 + np.arange(6)), 5)


@pytest.mark.parametrize(
    "way", [(0.002,), (0.008, 0.5, 0.3, 0.02), (0.04,), (0.04, 0.5, 0.3, 0.02), (0.02, 1.5, 0.8, 0.2)]
)
def test_stamps_of_an_arm_that_stops_and_goes_stay(way):
    t, q = stops_and_goes(*way)
    assert late_stamps(t, q, ROBOT.speed, FINE) is None


def test_stamps_of_a_recorder_with_blocks_of_another_rate_and_gaps_stay():
    t = np.cumsum(np.where(np.arange(4000) // 30 % 2, 0.032, 0.008))
    assert late_stamps(t, path_of(t), ROBOT.speed, FINE) is None
    t = np.arange(0, 60, 0.008)
    for begin in np.random.default_rng(0).integers(0, 7000, 40):
        t[begin : begin + 40] = np.nan
    t = t[np.isfinite(t)]
    assert late_stamps(t, path_of(t), ROBOT.speed, FINE) is None


def swing(row_s, stroke_s):
    t = np.arange(0, 60, row_s)
    return t, 0.3 * np.sin(2 * np.pi * t / stroke_s)[:, None] * np.array([1, 0.5, 0, 0, 0, 0.3])


def writes_on_change():
    t = np.arange(0, 60, 0.008)
    kept = (t % 10 < 5.01) | (t % 10 > 6.99)
    return t[kept], path_of(t - 2 * np.floor(t / 10) - np.clip(t % 10 - 5, 0, 2))[kept]


def loses_rows():
    t = np.arange(0, 120, 0.008)[np.random.default_rng(0).random(15000) > 0.7]
    return t, path_of(t)


def asynchronous():
    """A recorder at the controller's rate: some rows repeat a pose, as many skip one."""
    t = np.arange(0, 60, 0.01)
    late = np.random.default_rng(1).random(len(t)) < 0.03
    return t, path_of(np.where(late, t - 0.01, t))


@pytest.mark.parametrize(
    ("t", "q"),
    [swing(0.04, 0.5), swing(0.04, 0.8), swing(0.08, 1.6), swing(0.1, 1.3), swing(0.12, 2.0),
     stops_and_goes(0.04, 0.5, 0.3, 0.02), writes_on_change(), loses_rows(), asynchronous()],
    ids=["0.5", "0.8", "1.6", "1.3", "2.0", "stops", "on_change", "loses", "asynchronous"],
)  # fmt: skip
def test_true_stamps_of_an_arm_that_swings_rests_or_of_a_recorder_that_saves_rows_are_not_doubted(t, q):
    log = log_with(t, np.round(q, 5))
    assert log.quality.fault is None and log.quality.old < 0.005 * len(t)


@pytest.mark.parametrize(("row_s", "dwell_s", "noise"), [(0.04, 0.2, 1e-4), (0.04, 0.2, 3e-4), (0.008, 0.06, 1e-4)])
def test_poses_of_a_short_dwell_are_not_old(row_s, dwell_s, noise):
    t = np.arange(0, 60, row_s)
    cycle, step_s = 0.6 + dwell_s, 5e-4 if noise > 2e-4 else 1e-4
    part = np.clip(t % cycle / 0.6, 0, 1)
    x = np.abs((0.25 * (t // cycle + 3 * part**2 - 2 * part**3)) % 3 - 1.5)
    moved = np.array([1, 0.5, 0, 0, 0, 0])
    q = x[:, None] * moved + np.random.default_rng(0).normal(0, noise, (len(t), 6)) * (moved > 0)
    q = np.round(q / step_s) * step_s
    assert doubtful_rows(t, q, np.full(6, 3.14), np.full(6, step_s)).old.sum() < 0.02 * len(t)


@pytest.mark.parametrize(("set_s", "back_s"), [(3600.0, "3600.0"), (0.09, "0.078")])
def test_a_clock_that_is_set_back_while_the_arm_moves_is_named_with_its_row(real, set_s, back_s):
    t, q = real
    moving = int(np.argmax(np.linalg.norm(np.diff(q, axis=0), axis=1)))
    said = rf"row {moving + 3}: the time goes back by {back_s} s while the arm moves on"
    with pytest.raises(InputError, match=said):
        log_with(5000.0 + t - set_s * (np.arange(len(t)) > moving), q)
    swapped = np.arange(len(t))
    swapped[[moving, moving + 1]] = moving + 1, moving
    assert len(log_with(t[swapped], q[swapped]).time) == len(t)  # one row that came late


@pytest.mark.parametrize(("rows", "count"), [(slice(0, 12), 12), (slice(700, 710), 10), (slice(-15, None), 15)])
def test_zeros_of_a_driver_that_does_not_know_the_angles_are_left_out(real, rows, count):
    t, q = real
    broken = q.copy()
    broken[rows] = 0.0
    log = log_with(t, broken)
    assert len(log.time) == len(t) - count and "angles that the driver did not know" in log.note


def test_poses_that_are_held_over_many_rows_are_known():
    t = 0.001 * np.arange(5000)
    q = np.column_stack([1.5 * np.sin(2 * np.pi * 0.3 * t + axis) for axis in range(6)])[np.arange(5000) // 100 * 100]
    q -= q[2500]  # the arm passes zero
    assert log_with(t, q).note == ""


def test_times_in_minutes_are_refused(real):
    t, q = real
    with pytest.raises(InputError, match=r"times as fast as its limit .* in minutes"):
        check_log(log_with(t / 60, q), ROBOT)
    check_log(log_with(t, q), ROBOT)


def test_a_short_log_in_packets_is_not_in_minutes():
    row = np.arange(60)
    arrived = 0.008 * np.minimum((row // 25 + 1) * 25 - 1, 59) + 0.0002 * (row % 25)
    q = np.column_stack([0.8 * np.sin(2 * np.pi * (0.1 + 0.03 * axis) * 0.008 * row + axis) for axis in range(6)])
    check_log(log_with(arrived, q), ROBOT)


@pytest.mark.parametrize(("first", "rows", "joint"), [(600, 100, 1), (900, 20, 2), (1200, 150, 0)])
def test_rows_of_a_joint_whose_angle_is_not_refreshed_are_left_out(real, first, rows, joint):
    t, q = real
    stale = q.copy()
    stale[first : first + rows, joint] = q[first, joint]  # up to 0.54 rad, and more than a joint can jump
    log = log_with(t, stale)
    assert log.quality.frozen == (ROBOT.joint[joint].name,)
    np.testing.assert_array_equal(log.time, np.delete(t, np.arange(first + 1, first + rows)))
    assert "was not refreshed" in "; ".join(log.quality.sentences())


def in_turn(q):
    """Each joint's angle is new in every sixth row."""
    rows = np.arange(len(q))
    return np.column_stack([q[np.maximum((rows - joint) // 6 * 6 + joint, 0), joint] for joint in range(6)])


def on_change(q):
    """A joint's angle is new once it has changed by 0.5 degrees."""
    held = q.copy()
    for joint, row in itertools.product(range(6), range(1, len(q))):
        if abs(q[row, joint] - held[row - 1, joint]) < np.radians(0.5):
            held[row, joint] = held[row - 1, joint]
    return held


def test_joints_that_are_refreshed_in_turn_or_written_coarsely_are_not_frozen(real):
    t, q = real
    for angles in (q, np.round(q, 2), in_turn(q)):
        assert not frozen(t, angles, steps_of(angles), ROBOT.acceleration).any()


@pytest.mark.parametrize(("recorded", "share", "step"), [(in_turn, 0.05, 0.0015), (on_change, 0.9, 0.0090)])
def test_angles_that_are_refreshed_joint_by_joint_are_put_on_lines_between_new_ones(real, recorded, share, step):
    t, q = real
    t, q = t[:1500], q[:1500]
    log = log_with(t, recorded(q))
    assert len(log.quality.by_itself) > 3
    assert "record all joints in every row" in "; ".join(log.quality.sentences())
    lines, known = between_refreshes(t, recorded(q), np.full(6, 1e-4), ROBOT.speed)
    assert np.sqrt(np.mean((lines - q) ** 2)) < share * np.sqrt(np.mean((recorded(q) - q) ** 2))
    assert (known > 1e-4).sum() > 3 and (known < step).all()


def test_angles_of_few_digits_or_with_rests_are_new_in_every_row(real):
    t, q = real
    t, q = t[:1500], q[:1500]
    even = t[0] + 0.04 * np.arange(400)
    q25 = np.column_stack([np.interp(even, t, angle) for angle in q.T])
    for time, angles in (
        (t, q),
        (t, np.round(q, 2)),
        (t, np.round(q, 4)),
        (even, q25),
        (even, np.round(q25, 3)),
        (even, q25 // 0.0035 * 0.0035),
    ):
        np.testing.assert_array_equal(between_refreshes(time, angles, steps_of(angles), ROBOT.speed)[0], angles)


@pytest.mark.parametrize(("rate_Hz", "noise", "step", "speed"), [
    (500, 1e-4, 1e-4, 0.0), (125, 1e-4, 1e-4, 0.0), (500, 1e-4, 2 * np.pi / 8192, 0.0), (100, 2e-4, 1e-3, 0.0),
    (500, 1e-4, 1e-4, 0.5), (25, 1e-5, 1e-5, 0.5),
])  # fmt: skip
def test_the_noise_of_encoders_is_no_fault_of_the_rows(rate_Hz, noise, step, speed):
    rng, t = np.random.default_rng(2), np.arange(0, 15, 1 / rate_Hz)
    away = np.where(np.arange(6) < 3, 1.0, 0.3) * speed
    q = np.round((0.3 + away * np.sin(t)[:, None] + noise * rng.normal(size=(len(t), 6))) / step) * step
    quality = log_with(1000 + t, q).quality
    assert quality.bad <= 2 and quality.frozen_rows == 0  # noise may repeat a pose by chance
    assert not quality.by_itself and quality.rebuilt is None and quality.fault is None


def test_a_recorder_that_is_faster_than_the_controller_loses_no_row_and_finds_a_frozen_joint():
    t = np.arange(0, 6, 0.002)
    controller = np.floor(t * 125 + 1e-9) / 125
    phase = (controller[:, None] - 0.5 - 0.15 * np.arange(6)) % 2
    since = np.clip(np.minimum(phase, 1.5 - phase), 0, 0.5) / 0.5
    q = np.where(since < 0.5, 2 * since**2, 1 - 2 * (1 - since) ** 2) * 0.7 * ROBOT.acceleration * 0.5**2 / 4
    assert not frozen(t, q, np.full(6, 1e-6), ROBOT.acceleration).any()
    q[400:500, 1] = q[400, 1]
    found = frozen(t, q, np.full(6, 1e-6), ROBOT.acceleration)
    assert found[410:496, 1].all() and not found[:, [0, 2, 3, 4, 5]].any()
