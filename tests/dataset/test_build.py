"""Building a dataset, from good and from broken input."""

import numpy as np
import orjson
import pyarrow.parquet
import pytest

from acqd.dataset.build import BuildConfig, build
from acqd.dataset.manifest import load_manifest
from acqd.dataset.schema import read_columns
from acqd.robot import load_description
from acqd.robot.log_reader import read_log
from tests.campaigns import quiet, write_power


def test_merged_power_is_where_the_motion_is(campaign, dataset):
    robot = load_description(campaign[0].settings.robot)
    for path in sorted((dataset[0] / "recordings").glob("*.parquet")):
        table = pyarrow.parquet.read_table(path)
        units = orjson.loads(table.schema.metadata[b"units"])
        assert {name: units.get(name) for name in ("P", "q1", "valid")} == {"P": "W", "q1": "rad", "valid": None}
        step = np.diff(read_columns(path)["time_ns"])
        assert (step == 40_000_000).all()
        q = np.column_stack([table[f"q{k + 1}"].to_numpy() for k in range(robot.axes)])
        speed = np.abs(np.gradient(q, 0.04, axis=0)).sum(axis=1)
        P = table["P"].to_numpy()
        assert table["valid"].to_numpy().mean() > 0.98
        assert np.corrcoef(speed, P)[0, 1] > 0.15
        assert P[speed < 2e-3].mean() < P[speed > 0.3].mean()


@pytest.mark.slow
def test_missing_power_rows_are_bridged_and_long_gaps_are_not(cell, tmp_path):
    made, true, time_ns, P = cell
    kept = np.random.default_rng(0).random(len(P)) > 0.05
    moving = time_ns[P.mean() < P]  # most rows are of pauses
    middle = moving[len(moving) // 2]
    kept &= (time_ns < middle) | (time_ns > middle + 2_000_000_000)
    power = write_power(tmp_path / "p.csv", time_ns[kept], P[kept])
    build(BuildConfig(power, made.out / "logs", tmp_path / "ds", "iiwa7_r800"), quiet)
    manifest = load_manifest(tmp_path / "ds")
    whole = sum(entry["rows"] for entry in manifest["recordings"]) * 0.04
    valid = sum(entry["valid_s"] for entry in manifest["recordings"])
    assert whole - 2.5 < valid < whole
    assert all(abs(entry["lag_s"] - true[entry["name"]]) < 0.008 for entry in manifest["recordings"])


@pytest.mark.slow
def test_logs_without_power_and_a_stuck_meter_are_refused(cell, tmp_path):
    made, true, time_ns, P = cell
    paths = sorted((made.out / "logs").rglob("*.log"))
    half = time_ns < time_ns[0] + (time_ns[-1] - time_ns[0]) // 2
    power = write_power(tmp_path / "half.csv", time_ns[half], P[half])
    report = build(BuildConfig(power, made.out / "logs", tmp_path / "ds", "iiwa7_r800"), quiet)
    assert 2 <= len(report.refused) == 8 - report.recordings  # of the last, what has power may stay
    assert all(abs(e["lag_s"] - true[e["name"]]) < 0.01 for e in load_manifest(tmp_path / "ds")["recordings"])
    robot = load_description("iiwa7_r800")
    clock = read_log(paths[3], robot).time - made.settings.clock.offset_s
    stuck = P.copy()
    stuck[(time_ns * 1e-9 > clock[0] - 1) & (time_ns * 1e-9 < clock[-1] + 1)] = (
        155.0 + 5 * np.sin(np.arange(len(P)))[(time_ns * 1e-9 > clock[0] - 1) & (time_ns * 1e-9 < clock[-1] + 1)]
    )
    power = write_power(tmp_path / "stuck.csv", time_ns, stuck)
    report = build(BuildConfig(power, made.out / "logs", tmp_path / "d2", "iiwa7_r800"), quiet)
    assert len(report.refused) == 1 and paths[3].name in report.refused[0]
