"""Rows that were computed between the poses of a slower recorder."""

import numpy as np
import pytest
from scipy.interpolate import CubicSpline, PchipInterpolator

from acqd.robot.description import load_description
from acqd.robot.drawn_rows import drawn_every
from acqd.robot.log import in_time
from acqd.robot.log_reader import read_log
from tests.places import ROBOT_LOGS, needs_robot_logs

UR10E = load_description("ur10e")
CURVES = {
    "lines": lambda t, q: lambda at: np.column_stack([np.interp(at, t, axis) for axis in q.T]),
    "cubic spline": CubicSpline,
    "monotone": PchipInterpolator,
}


def real(path):
    log = read_log(path, UR10E)
    time, rows = in_time(log)
    return time - time[0], log.q[rows]


@needs_robot_logs
@pytest.mark.parametrize("curve", CURVES)
@pytest.mark.parametrize(
    ("hz", "rate"), [(10, 100), (10, 50), (5, 100), (12.5, 125), (10, 125), (12, 125), (15, 100), (7, 60)]
)
def test_rows_between_poses_are_told_with_the_distance_of_the_poses(curve, hz, rate, tmp_path):
    time, q = real(ROBOT_LOGS / "ur10e" / "ur-20_02_05-20sec_12harm.csv")
    at = np.arange(0, time[-1], 1 / hz)
    poses = np.column_stack([np.interp(at, time, axis) for axis in q.T])
    grid = np.arange(0, at[-1], 1 / rate)
    drawn = CURVES[curve](at, poses)(grid).round(7)
    if (curve, hz) != ("cubic spline", 5):  # smooth to the last digit
        assert drawn_every(grid, drawn) == pytest.approx(1 / hz, abs=6e-4)
    path = tmp_path / "log.csv"
    head = "time," + ",".join(f"q{axis + 1}" for axis in range(6))
    np.savetxt(path, np.column_stack([grid, drawn]), delimiter=",", header=head, comments="", fmt="%.7f")
    if (curve, hz, rate) == ("lines", 10, 100):
        assert any(
            "poses 100 ms apart: motion above 5 Hz" in line for line in read_log(path, UR10E).quality.sentences()
        )


@needs_robot_logs
def test_real_logs_of_three_robots_hold_rows_as_they_were_recorded():
    for robot, folder in (("ur10e", "ur10e"), ("ur3e", "ur3e_rtde"), ("kinova_gen3", "kinova_gen3")):
        for path in sorted((ROBOT_LOGS / folder).glob("*.csv")):
            assert read_log(path, load_description(robot)).quality.drawn_s == 0.0, path


@pytest.mark.parametrize("noise", [0.0, 1e-5])
def test_smooth_motion_ramps_and_noise_are_not_taken_for_drawn(noise):
    t = np.arange(0, 30, 0.01)
    random = np.random.default_rng(2)
    sines = np.column_stack([np.sin(w * t) for w in (0.7, 1.9, 3.1)])
    ramps = np.cumsum(np.clip(np.cumsum(random.choice([-1, 0, 1], size=(300, 3)).repeat(10, 0), 0), -20, 20), 0) * 1e-4
    coarse = np.round(np.column_stack([np.abs(w * t % 4 - 2) for w in (0.31, 0.47, 0.83)]), 3)  # at a constant speed
    assert drawn_every(t, coarse) == 0.0
    for q in (sines, ramps + 1e-4 * sines):
        assert drawn_every(t, q + noise * random.normal(size=q.shape)) == 0.0
    assert drawn_every(t, np.zeros((3000, 3))) == 0.0
    assert drawn_every(t[:8], sines[:8]) == drawn_every(t[:0], sines[:0]) == 0.0
    every_other = np.cumsum(np.tile([0.01, 0.03], 1500))[:-1]  # no step is near the median one
    assert drawn_every(every_other, sines[1:]) == 0.0
