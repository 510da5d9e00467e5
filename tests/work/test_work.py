"""Cycles in motion, and `acqd energy work` on a dataset with labels."""

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acqd.api.dataset import Dataset
from acqd.dataset.resample import resampled
from acqd.dataset.schema import read_columns
from acqd.models.segments import Segment
from acqd.robot import load_description
from acqd.robot.labels import from_numbers
from acqd.robot.log import in_time
from acqd.robot.log_reader import read_log
from acqd.work.cycle_energy import cycle_energy
from acqd.work.cycles import cycles_of
from acqd.work.labels import labelled
from tests.commands import acqd_here, refused
from tests.places import ROOT

STEP, AXES, T0 = 0.04, 6, 1_750_000_000.0
HOME, PICK, PLACE = np.zeros(AXES), np.linspace(0.9, -0.6, AXES), np.linspace(-0.8, 0.7, AXES)


def session(moves):
    """Angles at 25 Hz, from (target, seconds of motion, seconds of rest) of every move, and the times of departure."""
    at, now, left, times, points = HOME, 0.0, [], [0.0], [HOME]
    for target, seconds, rest in moves:
        left.append(now)
        share = np.linspace(0.0, 1.0, round(seconds / 0.01) + 1)[1:]
        shape = np.where(share < 0.5, 2 * share**2, 1 - 2 * (1 - share) ** 2)  # constant acceleration
        times += (now + share * seconds).tolist()
        points += (at + shape[:, None] * (target - at)).tolist()
        now += seconds + rest
        times.append(now)
        points.append(target)
        at = target
    t = np.arange(0.0, now, STEP)
    return np.column_stack([np.interp(t, times, column) for column in np.array(points).T]), np.array(left)


def cycles(waits, slow=()):
    """Moves of pick cycles: home, pick, place, home."""
    moves = [(HOME + 1e-9, 0.02, 1.0)]
    for k, wait in enumerate(waits):
        stretch = 1.8 if k in slow else 1.0
        moves += [(PICK, 1.0 * stretch, 0.3), (PLACE, 1.4 * stretch, 0.3), (HOME, 1.1 * stretch, wait)]
    return moves


@settings(max_examples=8, deadline=None)
@given(waits=st.lists(st.floats(0.5, 4.0), min_size=5, max_size=9), slow=st.integers(0, 4), seed=st.integers(0, 999))
def test_cycles_begin_where_the_arm_leaves_its_longest_rest(waits, slow, seed):
    q, left = session(cycles(waits, {slow}))
    q = q + np.random.default_rng(seed).normal(0, 2e-5, q.shape)
    found = cycles_of(q, STEP)
    assert np.abs(found.boundaries * STEP - left[1::3]).max() < 0.08
    assert len(found.begin) == len(waits) - 1  # the last one has no end


@settings(max_examples=8, deadline=None)
@given(seed=st.integers(0, 9999), rest=st.booleans())
def test_no_cycles_are_claimed_in_random_motion(seed, rest):
    random = np.random.default_rng(seed)
    moves = [
        (random.uniform(-1.5, 1.5, AXES), random.uniform(0.7, 2.0), random.uniform(0.3, 3.0) * rest) for _ in range(30)
    ]
    assert len(cycles_of(session(moves)[0], STEP).begin) == 0


def test_a_loop_without_rest_has_cycles_of_its_period():
    t = np.arange(0, 60, STEP)
    q = np.column_stack([np.sin(2 * np.pi * t / 5.0 + phase) for phase in range(AXES)])
    found = cycles_of(q, STEP)
    np.testing.assert_allclose((found.end - found.begin) * STEP, 5.0, atol=0.01)
    assert len(found.begin) >= 10
    assert len(cycles_of(np.zeros((500, AXES)), STEP).begin) == 0


@pytest.mark.parametrize(("name", "cycles"), [("ur-20_01_22-joint_1", 5), ("ur-20_01_17-ptp_10_points", 0)])
def test_a_real_arm_has_its_cycles_and_no_others(name, cycles):
    path = ROOT.parent / "shared" / "data" / "robots" / "ur10e" / f"{name}.csv"
    if not path.exists():
        pytest.skip(f"needs {path}")
    log = read_log(path, load_description("ur10e"))
    time, rows = in_time(log)
    grid = np.arange(time[0], time[-1], STEP)
    found = cycles_of(np.column_stack([resampled(grid, time, angle[rows], STEP) for angle in log.q.T]), STEP)
    assert len(found.begin) == cycles
    np.testing.assert_allclose((found.end - found.begin) * STEP, 10.0, atol=0.08)


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    """A session of 14 cycles: the fourth waits, the seventh is slow, the tenth takes more power (simulated)."""
    folder = tmp_path_factory.mktemp("work")
    waits = [1.0] * 14
    waits[3] = 6.0
    q, left = session(cycles(waits, {6}))
    t = T0 + STEP * np.arange(len(q))
    moving = np.append(np.abs(np.diff(q, axis=0)).max(axis=1) > 1e-6, False)
    number = np.clip((np.searchsorted(left, t - T0, side="right") - 2) // 3, -1, 13)
    P = 120.0 + 80.0 * moving + 60.0 * (moving & (number == 9)) + np.random.default_rng(1).normal(0, 0.3, len(q))
    rows = ["time,P,Vrms,flags", *(f"{a - STEP / 2:.6f},{b:.6f},230,simulated" for a, b in zip(t, P, strict=True))]
    (folder / "power.csv").write_text("\n".join([*rows, ""]))
    (folder / "logs").mkdir()
    names = ",".join(["timestamp", *(f"actual_q_{k}" for k in range(AXES)), "runtime_state", "part", "module"])
    modules = [_MODULES[k % 3] if k >= 0 else "" for k in number]
    lines = [
        f"{when:.6f}," + ",".join(f"{x:.8f}" for x in row) + f",{2 if k >= 0 else 1},{k},{module}"
        for when, row, k, module in zip(t, q, number, modules, strict=True)
    ]
    (folder / "logs" / "a.csv").write_text("\n".join([names, *lines, ""]))
    (folder / "robot.toml").write_text(own_description())
    done = acqd_here(
        *("dataset", "build", "--power", folder / "power.csv", "--logs", folder / "logs", "--lag", 0),
        *("--robot", folder / "robot.toml", "--out", folder / "ds"),
    )
    assert done.returncode == 0, done.stderr
    return folder / "ds"


_MODULES = ("Greifen", "Fügen 2", "Ablegen")


def own_description():
    """The UR10e with columns of parts and programs, which the user names."""
    shipped = ROOT / "acqd" / "robot" / "descriptions" / "ur10e.toml"
    state = 'state = "runtime_state"'
    return shipped.read_text().replace(state, f'{state}\npart = "part"\nprogram = "module"')


def test_outliers_have_a_cause_and_sums_are_the_measured_energy(dataset, tmp_path):
    done = acqd_here("energy", "work", dataset, "--json", "--csv", tmp_path / "c.csv", "--html", tmp_path / "c.html")
    assert done.returncode == 0, done.stderr
    said = json.loads(done.stdout)
    assert [each["outlier"] for each in said["cycles"]] == [
        {3: "waiting", 6: "slow", 9: "more power"}.get(k) for k in range(13)
    ]
    energy = sum(each["kWh"] for each in said["cycles"]) + sum(each["kWh"] for each in said["between"])
    assert energy == pytest.approx(said["measured_kWh"], rel=1e-9)
    with (tmp_path / "c.csv").open() as file:
        assert sum(float(line["kWh"]) for line in csv.DictReader(file)) == pytest.approx(energy, rel=1e-12)
    assert said["kinds"][0]["cycles"] == 13 and said["kinds"][0]["outliers"] == 3
    usual = said["cycles"][0]
    assert usual["kWh"] == pytest.approx((200 * 3.5 + 120 * 1.6) / 3.6e6, rel=0.02)
    assert "simulated data" in (tmp_path / "c.html").read_text()


def test_parts_and_states_from_the_log(dataset):
    by_part = json.loads(acqd_here("energy", "work", dataset, "--by", "part", "--json").stdout)
    kwh = {each["part"]: each["kWh"] for each in by_part["values"]}
    assert list(kwh) == [str(k) for k in range(-1, 14)]
    assert kwh["9"] == pytest.approx((260 * 3.5 + 120 * 1.6) / 3.6e6, rel=0.02)
    by_state = json.loads(acqd_here("energy", "work", dataset, "--by", "state", "--json").stdout)
    assert [each["state"] for each in by_state["values"]] == ["1", "2"]
    by_program = json.loads(acqd_here("energy", "work", dataset, "--by", "program", "--json").stdout)
    assert [each["program"] for each in by_program["values"]] == ["unknown", *_MODULES]
    assert [len(each["visit_kWh"]) for each in by_program["values"]][1:] == [5, 5, 4]
    for said in (by_part, by_state, by_program):
        assert sum(each["kWh"] for each in said["values"]) == pytest.approx(said["measured_kWh"], rel=1e-12)
        assert all(sum(e["visit_kWh"]) == pytest.approx(e["kWh"], rel=1e-12) for e in said["values"])


def test_a_log_without_the_column_is_refused(dataset):
    assert "have no column step" in refused(acqd_here("energy", "work", dataset, "--by", "step"))
    assert "expected cycle, program, step, part, state" in refused(acqd_here("energy", "work", dataset, "--by", "moon"))


def in_memory(moves, power, name="a", closed=0, **labels):
    """A segment of a session; `power` gives W of the motion in every cycle, brakes close in the first rows."""
    q, left = session(moves)
    moving = np.append(np.abs(np.diff(q, axis=0)).max(axis=1) > 1e-6, False)
    number = np.clip((np.searchsorted(left, STEP * np.arange(len(q)), side="right") - 2) // 3, 0, None)
    brake = (np.arange(len(q)) >= closed) * 1.0
    P = 100.0 + moving * power(number)
    return Segment(name, name, "other", "train", q, P, None, {"brake": brake}, T0 + 1000 * len(name), labels=labels)


def test_a_warm_up_and_standby_are_named_and_other_motion_is_another_path():
    first = in_memory(cycles([1.0] * 16), lambda k: 200 + 100 * np.exp(-k / 1.5), closed=10)
    mirrored = [(-target, seconds, rest) for target, seconds, rest in cycles([1.0] * 6)]
    found = cycle_energy([first, in_memory(mirrored, lambda k: 200.0, "bb")], STEP)
    assert {each.kind for each in found.cycles} == {1, 2}
    causes = [each.outlier for each in found.cycles if each.kind == 1]
    assert causes[:2] == ["warm-up", "warm-up"] and set(causes[8:]) == {""}
    between = {each.name: each for each in found.between}
    assert between["standby"].seconds == pytest.approx(10 * STEP) and set(between) == {
        "other motion",
        "idle",
        "standby",
    }
    total = sum(each.kWh for each in (*found.cycles, *found.between))
    assert total == pytest.approx(found.kWh, rel=1e-12)


def test_rows_without_a_number_are_unknown():
    segment = in_memory(cycles([1.0] * 3), lambda k: 200.0)
    step = from_numbers(np.where(np.arange(len(segment.P)) < 50, np.nan, np.arange(len(segment.P)) // 100 * 10.0))
    values = labelled([replace(segment, labels={"step": step})], "step", STEP, Path("ds"))
    assert [each.name for each in values][:3] == ["unknown", "0", "10"]
    assert sum(each.kWh for each in values) == pytest.approx(segment.P.sum() * STEP / 3.6e6, rel=1e-12)


def test_labels_go_through_tables_also_beside_numbers_of_earlier_versions(dataset, tmp_path):
    table = Dataset(dataset).to_arrow()
    again = Dataset.from_arrow(table, tmp_path / "again", robot=dataset.parent / "robot.toml")
    assert set(again.to_arrow()["program"].to_pylist()) == {"", *_MODULES}
    old = table.set_column(table.column_names.index("part"), "part", table["part"].cast("string").cast("float64"))
    pq.write_table(old.drop_columns(["recording", "split"]), tmp_path / "old.parquet")
    assert read_columns(tmp_path / "old.parquet")["part"].tolist() == table["part"].to_pylist()
