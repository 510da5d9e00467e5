"""Power that the log itself holds."""

import numpy as np
import pyarrow.parquet
import pytest

from acqd.dataset.manifest import load_manifest
from acqd.dataset.schema import columns_of
from acqd.errors import UserError
from acqd.robot import load_description
from acqd.robot.log import read_log
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
    table = pyarrow.parquet.read_table(tmp_path / "ds" / entry["file"])
    log = read_log(file, load_description("ur3e"))
    own = np.interp(columns_of(table)["time_ns"] * 1e-9, log.time, log.power)
    np.testing.assert_allclose(table["P"].to_numpy(), own, atol=0.05)  # the row is at the time of its sample


@pytest.mark.parametrize("step", [1, 3])
def test_faster_and_slower_power_is_where_the_motion_is(tmp_path, step):
    time, q, power = motion(20)
    write_log(tmp_path / "logs" / "a.csv", time[::step], q[::step], power[::step])
    build_from(tmp_path / "logs", tmp_path / "ds", cut_s=0)
    table = pyarrow.parquet.read_table(tmp_path / "ds" / "recordings" / "a.parquet")
    expected = np.interp(columns_of(table)["time_ns"] * 1e-9, time, power)
    assert np.corrcoef(table["P"].to_numpy()[5:-5], expected[5:-5])[0, 1] > 0.995


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
