"""Time shifts between logs and power, on campaigns whose true clock is known."""

import numpy as np
import pyarrow.parquet
import pytest

from acqd.dataset.build import BuildConfig, build
from acqd.dataset.manifest import load_manifest
from acqd.errors import UserError
from acqd.robot import load_description
from acqd.robot.log_reader import read_log
from tests.campaigns import build_dataset, campaign_config, measure, quiet, true_lags, write_power


def check_lags(campaign, folder, report, limit):
    made, true = campaign
    assert report.recordings == 8 and not report.refused and report.measured == "simulated"
    errors = np.array([entry["lag_s"] - true[entry["name"]] for entry in load_manifest(folder)["recordings"]])
    assert np.abs(errors).max() < limit, errors
    assert report.offset_s == pytest.approx(made.settings.clock.offset_s, abs=1.0)


@pytest.mark.long(seconds=10)
def test_lags_are_found_to_milliseconds(campaign, dataset):
    check_lags(campaign, *dataset, limit=0.005 if campaign[0].settings.robot == "iiwa7_r800" else 0.010)


@pytest.mark.slow
def test_lags_are_found_to_milliseconds_without_torques(campaign, tmp_path):
    check_lags(campaign, tmp_path / "ds", build_dataset(campaign[0], tmp_path / "ds", torque="model"), limit=0.010)


def test_a_log_of_another_day_is_refused_not_placed(campaign, tmp_path):
    made, _ = campaign
    robot = load_description(made.settings.robot)
    random = np.random.default_rng(0)
    t = read_log(min(made.out.rglob("logs/*/*")), robot).time[0] + np.arange(0, 40, 0.04)
    wander = np.cumsum(random.normal(0, 0.004, (len(t), robot.axes)), axis=0)
    header = ",".join(["time", *(f"q{k + 1}" for k in range(robot.axes))])
    rows = [f"{stamp:.6f}," + ",".join(f"{x:.6f}" for x in row) for stamp, row in zip(t, wander, strict=True)]
    (tmp_path / "stranger.csv").write_text("\n".join([header, *rows, ""]))
    power = str(made.out / "power.sqlite")
    with pytest.raises(UserError, match="none of 1 logs can be placed"):
        build(BuildConfig(power, tmp_path / "stranger.csv", tmp_path / "alone", made.settings.robot), quiet)
    assert not (tmp_path / "alone").exists()


@pytest.mark.slow
def test_a_clock_just_beyond_the_search_range_is_not_met_at_its_edge(campaign, tmp_path):
    made, true = campaign
    if made.settings.robot == "kinova_gen3":
        pytest.skip("one clock that is ahead and one that is behind are enough")
    report = build_dataset(made, tmp_path / "ds", search_s=abs(made.settings.clock.offset_s) - 0.1)
    assert not report.notes
    for entry in load_manifest(tmp_path / "ds")["recordings"]:
        assert entry["own_lag"]["s"] == pytest.approx(true[entry["name"]], abs=0.03)


@pytest.mark.slow
@pytest.mark.parametrize("step_ms", [20.0, 100 / 3])
def test_windows_of_any_length_are_aligned(cell, tmp_path, step_ms):
    made, true, time_ns, P = cell
    t, step = (time_ns - time_ns[0]) * 1e-9, step_ms / 1000
    energy = np.concatenate([[0.0], np.cumsum(P * 0.04)])
    grid = np.arange(int(t[-1] / step)) * step
    mean = np.diff(np.interp(np.append(grid, grid[-1] + step), np.append(t, t[-1] + 0.04), energy)) / step
    power = write_power(tmp_path / "p.csv", time_ns[0] + np.rint(grid * 1e9), mean)
    build(BuildConfig(power, made.out / "logs", tmp_path / "ds", "iiwa7_r800"), quiet)
    recordings = load_manifest(tmp_path / "ds")["recordings"]
    assert len(recordings) == 8
    for entry in recordings:
        # rows of 20 ms made from rows of 40 ms are smoothed like rows of 40 ms, which looks like a slower supply
        assert entry["lag_s"] == pytest.approx(true[entry["name"]], abs=0.010)


@pytest.mark.slow
def test_the_same_assembly_again_and_again_with_the_peak_of_its_brakes_is_placed(tmp_path):
    """Every execution fits in many places of the stream, and the peak is more than all that motion explains."""
    made = campaign_config(tmp_path, profile="use-case", assemblies=6, session=6, seed=9, clock={"offset_s": 1.24})
    measure(made)
    report = build_dataset(made, tmp_path / "ds")
    assert report.refused == []
    right = true_lags(made.settings, made.truth)
    found = {entry["name"]: entry["lag_s"] for entry in load_manifest(tmp_path / "ds")["recordings"]}
    assert max(abs(found[name] - lag) for name, lag in right.items()) < 0.015
    brakes = np.concatenate(
        [
            pyarrow.parquet.read_table(tmp_path / "ds" / "recordings" / f"{name}.parquet")["brake"].to_numpy()
            for name in found
        ]
    )
    assert ((brakes >= 0) & (brakes <= 1)).all()
    assert ((brakes > 0.01) & (brakes < 0.99)).any()  # the share of a row in which they are open
