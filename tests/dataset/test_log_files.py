"""Logs of which some cannot be used."""

from dataclasses import replace

import numpy as np
import pytest

from acqd.dataset.build import BuildConfig, build
from acqd.dataset.log_files import content_hash
from acqd.dataset.manifest import load_manifest
from acqd.errors import UserError
from tests.campaigns import quiet, write_power
from tests.dataset.logs import AXES, build_from, motion, write_log, write_logs


def spoil(folder):
    """One usable log beside one of each kind that is not."""
    time, q, power = motion(12)
    write_log(folder / "good.csv", time, q, power)
    write_log(folder / "slow.csv", time[::50], q[::50], power[::50])
    write_log(folder / "degrees.csv", time, np.degrees(q) + 90, power)
    milliamperes = {f"current{k + 1}": 2000 + 500 * np.sin(time) for k in range(AXES)}
    write_log(folder / "milli.csv", time, q + 0.01, power, **milliamperes)
    stamps = time.copy()
    stamps[::30] = 1e14
    write_log(folder / "stamps.csv", stamps, q, power)
    days = time.copy()
    days[len(days) // 2 :] += 1e9
    write_log(folder / "days.csv", days, q, power)
    clumps = time + 1000.0 * (np.arange(len(time)) // 100)
    write_log(folder / "clumps.csv", clumps, q + 0.02, power)
    write_log(folder / "epoch.csv", 1.7e12 + time, q, power)
    write_log(folder / "braked.csv", time, q + 0.03, power, brake=np.zeros(len(time)))
    doubled = (folder / "good.csv").read_text().splitlines()
    header, *rows = (f"{line},{line.split(',')[-1]}" for line in doubled)
    (folder / "doubled.csv").write_text("\n".join([header, *rows]))
    (folder / "text.csv").write_text("this is,no log\n")
    (folder / "twin.csv").write_bytes((folder / "good.csv").read_bytes())
    return folder


COMPLAINTS = {
    "braked": "s of them with closed brakes; expected brake 1 where the brakes are open",
    "clumps": "has 600 rows in 1.39 h, most of them 0.02 s apart",
    "doubled": "has several columns 'power'; expected one",
    "epoch": "its times are about 1.7e+12 s; expected seconds before 2200",
    "days": "time jumps by 11574 days after data row 300",
    "degrees": "limit",
    "milli": "wrist_2 draws a current of 2500, but 3.13 A are its greatest torque: are the currents in mA",
    "slow": "has a row every 1 s, expected one every 0.125 s or faster",
    "stamps": "time 1e+14 s does not belong between its neighbours (20 of 600 rows are garbled)",
    "text": "has no rows of numbers",
    "twin": "has the same content as good.csv",
}


@pytest.mark.parametrize("lag", [None, 0.0])
def test_bad_logs_are_named_and_the_others_go_on(tmp_path, lag):
    time, _, power = motion(12)
    origin = "log" if lag is None else write_power(tmp_path / "p.csv", np.rint(time * 1e9), power)
    config = BuildConfig(origin, spoil(tmp_path / "logs"), tmp_path / "ds", "ur3e", lag_s=lag, cut_s=0)
    report = build(config, quiet)
    assert report.recordings == 1 and len(report.refused) == len(COMPLAINTS)
    for name, complaint in COMPLAINTS.items():
        line = next(line for line in report.refused if f"{name}.csv" in line)
        assert complaint in line and "\n" not in line


def test_power_with_the_wrong_sign_is_refused_and_kilowatts_are_noted(tmp_path):
    time, q, power = motion(12)
    for number, (factor, name) in enumerate([(1e-3, "kw"), (1e-3, "kw2"), (-1.0, "sign")]):
        write_log(tmp_path / "logs" / f"{name}.csv", time, q + 0.01 * number, factor * power)
    report = build(BuildConfig("log", tmp_path / "logs", tmp_path / "ds", "ur3e", cut_s=0), quiet)
    assert len(report.refused) == 1 and "sign.csv: its power is -" in report.refused[0]
    assert any("little for a robot: is it in kW?" in note for note in report.notes)


def test_columns_that_only_some_logs_have_are_noted(tmp_path):
    time, q, power = motion(12)
    brake = {"brake": np.ones(len(time))}
    write_log(tmp_path / "logs" / "a.csv", time, q, power, **brake)
    write_log(tmp_path / "logs" / "b.csv", time, q + 0.01, power)
    report = build(BuildConfig("log", tmp_path / "logs", tmp_path / "ds", "ur3e", cut_s=0), quiet)
    (note,) = (note for note in report.notes if "have no brake" in note)
    assert "1 of 2 logs" in note and "b.csv" in note


def test_a_few_garbled_rows_are_a_note(tmp_path):
    time, q, power = motion(12)
    time[77] = 1e300
    write_log(tmp_path / "logs" / "a.csv", time, q, power)
    report = build_from(tmp_path / "logs", tmp_path / "ds", cut_s="auto")
    assert any("a.csv: 1 of 600 rows garbled and left out: row 79" in note for note in report.notes)


@pytest.mark.parametrize("count", [1, 3])
def test_logs_of_another_robot_are_one_line(tmp_path, count):
    write_logs(tmp_path / "logs", count)
    with pytest.raises(UserError, match="has 6 columns qN, but iiwa7_r800 has 7 axes") as caught:
        build_from(tmp_path / "logs", tmp_path / "ds", robot="iiwa7_r800")
    assert "\n" not in str(caught.value) and ("none of 3 logs" in str(caught.value)) == (count == 3)


def test_a_folder_without_logs_or_with_two_of_a_name(tmp_path):
    with pytest.raises(UserError, match="no such folder or log"):
        build_from(tmp_path / "nothing", tmp_path / "ds")
    (tmp_path / "empty").mkdir()
    with pytest.raises(UserError, match=r"no robot logs \(.log, .csv, .txt, .parquet, .mcap, .db3, .bag\) there"):
        build_from(tmp_path / "empty", tmp_path / "ds")
    (tmp_path / "empty" / "rec.csv.gz").write_bytes(b"\x1f\x8b")
    with pytest.raises(UserError, match=r"there; rec\.csv\.gz is compressed: unpack it first"):
        build_from(tmp_path / "empty", tmp_path / "ds")
    write_logs(tmp_path / "logs" / "a", 1)
    write_logs(tmp_path / "logs" / "b", 1)
    with pytest.raises(UserError, match=r"two logs are named rec_0001: a.rec_0001\.csv and b.rec_0001\.csv"):
        build_from(tmp_path / "logs", tmp_path / "ds")


def test_a_bag_in_a_folder_is_one_log_with_a_hash_of_its_files(tmp_path):
    bags = pytest.importorskip("tests.robot.test_bag", reason="rosbags is not installed")
    messages = [(10_000_000 * k, bags.state(k, bags.NAMES)) for k in range(500)]
    bags.write_bag(tmp_path / "logs" / "run1", {"/joint_states": messages})
    at = 1.7e9 + np.arange(0, 5, 0.04)
    power = write_power(tmp_path / "p.csv", np.rint(at * 1e9), 60 + np.sin(at))
    config = BuildConfig(power, tmp_path / "logs", tmp_path / "ds", "ur10e", lag_s=0.0)
    assert build(config, quiet).recordings == 1
    entry = load_manifest(tmp_path / "ds")["recordings"][0]
    assert entry["name"] == "run1" and entry["log"] == {
        "path": str(tmp_path / "logs" / "run1"), "sha256": content_hash(tmp_path / "logs" / "run1"), "rows": 500,
    }  # fmt: skip
    with pytest.raises(UserError, match="nothing new, 1 of its logs"):
        build(replace(config, append=True), quiet)
