"""Power that the log itself holds."""

import numpy as np
import pytest

from acqd.dataset.manifest import load_manifest
from acqd.dataset.schema import read_columns
from acqd.errors import UserError
from acqd.robot import load_description
from acqd.robot.log_reader import read_log
from tests.dataset.logs import build_from, motion, write_log
from tests.places import ROBOT_LOGS, needs_robot_logs


@needs_robot_logs
def test_a_real_log_with_its_power_needs_no_alignment(tmp_path):
    file = ROBOT_LOGS / "ur3e_rtde" / "ur3e_rtde_25s.csv"
    report = build_from(file, tmp_path / "ds", cut_s=0)
    assert report.recordings == 1 and report.measured == "bus" and not report.refused
    assert any("with one clock: nothing was aligned" in note for note in report.notes)
    entry = load_manifest(tmp_path / "ds")["recordings"][0]
    assert entry["lag_s"] == 0 and entry["valid_s"] > 24.8
    table = read_columns(tmp_path / "ds" / entry["file"])
    log = read_log(file, load_description("ur3e"))
    own = np.interp(table["time_ns"] * 1e-9, log.time, log.power)
    np.testing.assert_allclose(table["P"], own, atol=0.05)  # the row is at the time of its sample


@pytest.mark.parametrize("step", [1, 3])
def test_faster_and_slower_power_is_where_the_motion_is(tmp_path, step):
    time, q, power = motion(20)
    write_log(tmp_path / "logs" / "a.csv", time[::step], q[::step], power[::step])
    build_from(tmp_path / "logs", tmp_path / "ds", cut_s=0)
    table = read_columns(tmp_path / "ds" / "recordings" / "a.parquet")
    expected = np.interp(table["time_ns"] * 1e-9, time, power)
    assert np.corrcoef(table["P"][5:-5], expected[5:-5])[0, 1] > 0.995


def test_logs_without_power_are_named(tmp_path):
    time, q, power = motion(10)
    write_log(tmp_path / "logs" / "with.csv", time, q, power)
    write_log(tmp_path / "logs" / "without.csv", time + 50, q)
    write_log(tmp_path / "logs" / "stuck.csv", time + 90, q, np.full(len(time), 60.0))
    report = build_from(tmp_path / "logs", tmp_path / "ds")
    assert report.recordings == 1 and len(report.refused) == 2
    assert "stuck.csv: its power is constant or missing" in report.refused[0]
    assert "without.csv: holds no power: expected the column power [W]" in report.refused[1]
    (tmp_path / "logs" / "with.csv").unlink()
    with pytest.raises(UserError, match="none of 2 logs can be used; the first: .*stuck.csv"):  # noqa: RUF043
        build_from(tmp_path / "logs", tmp_path / "ds2")
    assert not (tmp_path / "ds2").exists()


def test_a_known_lag_of_the_motion_counts_in_one_log_too(tmp_path):
    time, q, power = motion(20)
    late = np.column_stack([np.interp(time - 0.2, time, column) for column in q.T])
    for name, angles in (("whole", q), ("late", late)):
        write_log(tmp_path / name / "a.csv", time, angles, power)
    build_from(tmp_path / "whole", tmp_path / "ds", cut_s=0)
    report = build_from(tmp_path / "late", tmp_path / "shifted", cut_s=0, lag_s=0.2)
    tables = [read_columns(tmp_path / ds / "recordings" / "a.parquet") for ds in ("ds", "shifted")]
    rows = np.intersect1d(*(table["time_ns"] for table in tables))[50:-50]
    assert len(rows) > 300
    angles = [table["q1"][np.isin(table["time_ns"], rows)] for table in tables]
    np.testing.assert_allclose(angles[0], angles[1], atol=0.01 * np.ptp(angles[0]))
    assert not any("nothing was aligned" in note for note in report.notes)
