"""Merging and time shifts: on campaigns whose true clock is known, for several robots, and on broken input."""

import json
import sqlite3
import subprocess
import sys
from pathlib import Path

import numpy as np
import pyarrow.parquet
import pytest

from acqd.dataset.build import BuildConfig, build
from acqd.dataset.manifest import load_manifest
from acqd.dataset.merge import merge
from acqd.dataset.power import PowerStream, open_power
from acqd.dataset.split import source_of, split
from acqd.errors import InputError, UserError
from acqd.lab.campaign.run import CampaignConfig, run_campaign
from acqd.lab.settings import CampaignSettings
from acqd.robot import load_description
from acqd.robot.log import RobotLog, read_log
from acqd.timestamps import parse_times

CASES = {
    "iiwa7_r800": {"clock": {"offset_s": 30.0, "drift_ppm": 50.0}, "seed": 11},
    "ur10e": {"clock": {"offset_s": -29.0, "drift_ppm": -50.0}, "seed": 12},
    "kinova_gen3": {"clock": {"offset_s": 7.3, "drift_ppm": 20.0}, "seed": 13, "mains": {"shape": "rectifier"}},
}


@pytest.fixture(scope="module", params=list(CASES))
def campaign(request, tmp_path_factory):
    folder = tmp_path_factory.mktemp(request.param)
    settings = CampaignSettings(
        robot=request.param, limited=4, all_space=4, session=4, recorder={"missing": 0.05}, **CASES[request.param]
    )
    out = folder / "c"
    run_campaign(CampaignConfig(settings, out, folder / "t", f"{out}/power.sqlite", 2), lambda what, share: None)
    return settings, out, folder / "t"


def true_lags(settings, truth):
    """Controller minus power clock at the middle of every recording."""
    lags = {}
    for session in json.loads((truth / "truth.json").read_text())["sessions"]:
        with np.load(truth / f"{session['session']}.npz") as arrays:
            begin = (int(arrays["start_utc_ns"]) - settings.start_utc_ns) * 1e-9
        for recording in session["recordings"]:
            middle = begin + recording["start_s"] + recording["seconds"] / 2
            lags[recording["name"]] = settings.clock.offset_s + settings.clock.drift_ppm * 1e-6 * middle
    return lags


def make(out, folder, **options):
    settings = {"robot": "iiwa7_r800", **options}
    return build(BuildConfig(str(out / "power.sqlite"), out / "logs", folder, **settings), lambda what, share: None)


def test_lags_are_found_to_milliseconds_with_torques_and_without(campaign, tmp_path):
    settings, out, truth = campaign
    for torque in (None, "model"):
        report = make(out, tmp_path / str(torque), robot=settings.robot, torque=torque)
        assert report.recordings == 8 and not report.refused and report.measured == "simulated"
        manifest = load_manifest(tmp_path / str(torque))
        true = true_lags(settings, truth)
        errors = np.array([entry["lag_s"] - true[entry["name"]] for entry in manifest["recordings"]])
        limit = 0.005 if settings.robot == "iiwa7_r800" and torque is None else 0.010
        assert np.abs(errors).max() < limit, (torque, errors)
        assert report.offset_s == pytest.approx(settings.clock.offset_s, abs=1.0)


def test_merged_power_is_where_the_motion_is(campaign, tmp_path):
    settings, out, _ = campaign
    make(out, tmp_path / "ds", robot=settings.robot)
    for path in sorted((tmp_path / "ds" / "recordings").glob("*.parquet")):
        table = pyarrow.parquet.read_table(path)
        step = np.diff(table["time_ns"].to_numpy())
        assert (step == 40_000_000).all()
        q = np.column_stack([table[f"q{k + 1}"].to_numpy() for k in range(len(load_description(settings.robot).joint))])
        speed = np.abs(np.gradient(q, 0.04, axis=0)).sum(axis=1)
        P = table["P"].to_numpy()
        assert table["valid"].to_numpy().mean() > 0.98
        assert np.corrcoef(speed, P)[0, 1] > 0.15
        assert P[speed < 2e-3].mean() < P[speed > 0.3].mean()


def test_a_log_of_another_day_is_refused_not_placed(campaign, tmp_path):
    settings, out, _ = campaign
    robot = load_description(settings.robot)
    logs = tmp_path / "logs"
    logs.mkdir()
    for path in sorted(out.rglob("logs/*/*"))[:5]:
        (logs / path.name).write_bytes(path.read_bytes())
    random = np.random.default_rng(0)
    t = read_log(next(iter(sorted(logs.iterdir()))), robot).time[0] + np.arange(0, 40, 0.04)
    wander = np.cumsum(random.normal(0, 0.004, (len(t), robot.axes)), axis=0)
    header = ",".join(["time", *(f"q{k + 1}" for k in range(robot.axes))])
    rows = [f"{stamp:.6f}," + ",".join(f"{x:.6f}" for x in row) for stamp, row in zip(t, wander, strict=True)]
    (logs / "stranger.csv").write_text("\n".join([header, *rows, ""]))
    order = BuildConfig(str(out / "power.sqlite"), logs / "stranger.csv", tmp_path / "alone", settings.robot)
    with pytest.raises(UserError, match="none of 1 logs can be placed"):
        build(order, lambda what, share: None)
    assert not (tmp_path / "alone").exists()


def test_one_clock_that_was_set_in_between_is_announced(campaign, tmp_path):
    settings, out, truth = campaign
    if settings.robot != "iiwa7_r800":
        pytest.skip("one robot is enough")
    logs = tmp_path / "logs"
    logs.mkdir()
    paths = sorted(out.rglob("logs/*/*"))
    for path in paths:
        (logs / path.name).write_text(path.read_text())
    lines = (logs / paths[2].name).read_text().splitlines()
    shifted = [lines[0]]
    for line in lines[1:]:
        seconds, ns, rest = line.split(" ", 2)
        ms = int(seconds) * 1000 + int(ns) // 1_000_000 + 200
        shifted.append(f"{ms // 1000} {ms % 1000 * 1_000_000} {rest}")
    (logs / paths[2].name).write_text("\n".join([*shifted, ""]))
    order = BuildConfig(str(out / "power.sqlite"), logs, tmp_path / "ds", settings.robot)
    report = build(order, lambda what, share: None)
    assert len(report.notes) == 1 and paths[2].name in report.notes[0] and "was it set?" in report.notes[0]
    entry = next(e for e in load_manifest(tmp_path / "ds")["recordings"] if e["name"] == paths[2].stem)
    expected = true_lags(settings, truth)[paths[2].stem] + 0.2
    assert entry["lag_by"] == "own" and entry["lag_s"] == pytest.approx(expected, abs=0.01)


def test_a_clock_just_beyond_the_search_range_is_not_met_at_its_edge(campaign, tmp_path):
    settings, out, truth = campaign
    true = true_lags(settings, truth)
    report = make(out, tmp_path / "ds", robot=settings.robot, search_s=abs(settings.clock.offset_s) - 0.1)
    assert not report.notes
    for entry in load_manifest(tmp_path / "ds")["recordings"]:
        assert entry["own_lag"]["s"] == pytest.approx(true[entry["name"]], abs=0.03)


def rows(count=200):
    t = np.arange(count) * 0.04
    return t, 150 + 20 * np.sin(t)


@pytest.mark.parametrize("form", ["rfc3339", "s", "ms", "ns", "filetime", "jsonl", "parquet"])
def test_rows_are_read_from_any_file_with_any_clock(tmp_path, form):
    t, P = rows()
    base = 1_626_163_200
    clock = {
        "rfc3339": [f"2021-07-13T08:00:{s:09.6f}Z" for s in t],
        "s": [f"{base + s:.6f}" for s in t],
        "ms": [str(round((base + s) * 1000)) for s in t],
        "ns": [str(base * 10**9 + round(s * 1e9)) for s in t],
        "filetime": [str((base + 11_644_473_600) * 10**7 + round(s * 1e7)) for s in t],
    }.get(form, [f"2021-07-13T08:00:{s:09.6f}Z" for s in t])
    name = "filetime" if form == "filetime" else "time"
    if form == "jsonl":
        path = tmp_path / "p.jsonl"
        path.write_text(
            "".join(json.dumps({"time": a, "P": b, "flags": []}) + "\n" for a, b in zip(clock, P, strict=True))
        )
    elif form == "parquet":
        path = tmp_path / "p.parquet"
        pyarrow.parquet.write_table(pyarrow.table({"time": clock, "P": P}), path)
    else:
        path = tmp_path / "p.csv"
        path.write_text("\n".join([f"{name},P", *(f"{a},{b}" for a, b in zip(clock, P, strict=True)), ""]))
    stream = open_power(str(path), None, None)
    np.testing.assert_allclose(stream.time_ns * 1e-9 - base, t, atol=1e-6)
    np.testing.assert_allclose(stream.P, P)
    assert stream.window_ns == 40_000_000


def test_duplicates_and_disorder_are_put_right_and_flagged_rows_are_left_out(tmp_path):
    t, P = rows()
    order = [5, 4, *range(200), 7, 7]
    flags = {9: '"[""gap""]"'}
    lines = [f"{1_626_163_200 + t[k]:.3f},{P[k]},{flags.get(k, '[]')}" for k in order]
    (tmp_path / "p.csv").write_text("\n".join(["time,P,flags", *lines, ""]))
    stream = open_power(str(tmp_path / "p.csv"), None, None)
    assert len(stream.time_ns) == 200 and stream.dropped == 4
    assert (np.diff(stream.time_ns) > 0).all()
    assert np.flatnonzero(np.isnan(stream.P)).tolist() == [9]


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("time,power\n1,2\n2,3\n3,4\n", "needs the columns time .or filetime. and P; it has time, power"),
        ("time,P\nsoon,1\nlater,2\nnever,3\n", "time 'soon' is neither RFC 3339 nor a number"),
        ("time,P\n1,5\n2,5\n3,5\n4,5\n", "P is constant or missing"),
        ("time,P\n1,5\n", "fewer than three rows"),
        ("time,P,device\n1,5,a\n2,6,b\n3,6,a\n", "holds several devices; choose one with --device: a, b"),
    ],
)
def test_rows_that_cannot_be_used_are_named(tmp_path, text, complaint):
    (tmp_path / "p.csv").write_text(text)
    with pytest.raises(UserError, match=complaint):
        open_power(str(tmp_path / "p.csv"), None, None)


def test_a_gap_in_either_side_is_no_valid_row():
    t = np.arange(0, 20, 0.04)
    time_ns = np.rint((1000 + t) * 1e9).astype(np.int64)
    keep = (t < 5) | (t > 6)
    power = PowerStream(time_ns[keep], (100 + t)[keep], 0 * t[keep] + 230, 40_000_000, 0, False, "x")
    own = np.arange(0.5, 19, 0.04)
    own = own[(own < 10) | (own > 12)]
    log = RobotLog(Path("x.csv"), own + 1003.0, np.column_stack([own, 2 * own]))
    recording = merge("x", log, power, 3.0, 0.0, 0.04)
    at = (recording.time_ns - time_ns[0]) * 1e-9 - 0.02
    inside = recording.valid
    assert not inside[(at > 5.1) & (at < 5.9)].any() and not inside[(at > 10.2) & (at < 11.8)].any()
    assert inside[(at > 1) & (at < 4.8)].all() and inside[(at > 12.3) & (at < 18)].all()
    np.testing.assert_allclose(recording.columns["P"][inside], 100 + at[inside], atol=1e-6)
    np.testing.assert_allclose(recording.columns["q2"][inside], 2 * (at[inside] + 0.02), atol=1e-6)


def test_a_faster_log_is_averaged_before_it_is_thinned():
    t = np.arange(0, 10, 0.04)
    power = PowerStream(np.rint((50 + t) * 1e9).astype(np.int64), 100 + t, 0 * t, 40_000_000, 0, False, "x")
    own = np.arange(0, 9.9, 0.001)
    hum = np.sin(2 * np.pi * 50 * own)  # twice per 40 ms: alias to nothing but noise if only picked
    log = RobotLog(Path("x.csv"), own + 50, (own + hum)[:, None])
    recording = merge("x", log, power, 0.0, 0.0, 0.04)
    at = recording.time_ns * 1e-9 - 50
    inner = slice(2, -2)
    np.testing.assert_allclose(recording.columns["q1"][inner], at[inner], atol=0.01)


def test_no_source_is_on_two_sides_and_shares_are_kept():
    sources = {f"limited_{k:02d}": 200.0 + k for k in range(46)} | {f"all_{k:02d}": 320.0 for k in range(30)}
    parts = split(sources, 1)
    for kind, total in (("limited", 46), ("all", 30)):
        counts = [
            sum(part == side and name.startswith(kind) for name, part in parts.items())
            for side in ("train", "validation", "test")
        ]
        assert sum(counts) == total
        np.testing.assert_allclose(np.array(counts) / total, [0.74, 0.12, 0.14], atol=0.06)
    assert split(sources, 1) == parts != split(sources, 2)
    assert source_of("limited_07_0123") == "limited_07" and source_of("run1") == "run1"


def test_times_keep_their_nanoseconds():
    stamps = parse_times(Path("x"), "time", ["2021-07-13T08:00:00.123456+02:00", "2021-07-13T06:00:00.123456Z"])
    assert stamps[0] == stamps[1] == 1_626_156_000_123_456_000
    with pytest.raises(InputError, match="is not a Unix time"):
        parse_times(Path("x"), "time", [1e25])


def run_acqd(*arguments, **options):
    command = [sys.executable, "-P", "-m", "acqd", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=100, **options)


def test_the_command_builds_shows_and_refuses(campaign, tmp_path):
    settings, out, _ = campaign
    arguments = ["dataset", "build", "--logs", out / "logs", "--robot", settings.robot, "--out", tmp_path / "ds"]
    built = run_acqd(*arguments, "--power", out / "power.sqlite", "--json")
    assert built.returncode == 0, built.stderr
    assert json.loads(built.stdout)["recordings"] == 8
    shown = run_acqd("dataset", "show", tmp_path / "ds")
    assert shown.returncode == 0 and "clock line" in shown.stdout and "simulated" in shown.stdout
    again = run_acqd(*arguments, "--power", out / "power.sqlite")
    assert again.returncode == 2 and "exists; choose another --out" in again.stderr
    wrong = run_acqd(*arguments[:-1], tmp_path / "other", "--power", tmp_path / "nothing.sqlite")
    assert wrong.returncode == 2 and "does not exist" in wrong.stderr and "Traceback" not in wrong.stderr
    with sqlite3.connect(tmp_path / "flat.sqlite") as database:
        database.execute("CREATE TABLE unrelated (x)")
    none = run_acqd("dataset", "show", tmp_path)
    assert none.returncode == 2 and "is not a dataset" in none.stderr


@pytest.fixture(scope="module")
def cell(tmp_path_factory):
    """A small campaign of the iiwa, and its power as arrays."""
    folder = tmp_path_factory.mktemp("cell")
    settings = CampaignSettings(limited=4, all_space=4, session=8, seed=31)
    out = folder / "c"
    run_campaign(CampaignConfig(settings, out, folder / "t", f"{out}/power.sqlite", 2), lambda what, share: None)
    stream = open_power(f"{out}/power.sqlite", None, None)
    return settings, out, true_lags(settings, folder / "t"), np.array(stream.time_ns), np.array(stream.P)


def write_power(path, time_ns, P):
    rows = [f"{t / 1e9:.6f},{p:.5f}" for t, p in zip(time_ns, P, strict=True)]
    path.write_text("\n".join(["time,P", *rows, ""]))
    return str(path)


@pytest.mark.parametrize("step_ms", [5.0, 25.0, 100 / 3])
def test_windows_of_any_length_are_aligned(cell, tmp_path, step_ms):
    _, out, true, time_ns, P = cell
    t, step = (time_ns - time_ns[0]) * 1e-9, step_ms / 1000
    energy = np.concatenate([[0.0], np.cumsum(P * 0.04)])
    grid = np.arange(int(t[-1] / step)) * step
    mean = np.diff(np.interp(np.append(grid, grid[-1] + step), np.append(t, t[-1] + 0.04), energy)) / step
    power = write_power(tmp_path / "p.csv", time_ns[0] + np.rint(grid * 1e9), mean)
    build(BuildConfig(power, out / "logs", tmp_path / "ds", "iiwa7_r800"), lambda what, share: None)
    for entry in load_manifest(tmp_path / "ds")["recordings"]:
        assert entry["lag_s"] == pytest.approx(true[entry["name"]], abs=0.008)


def test_missing_power_rows_are_bridged_and_long_gaps_are_not(cell, tmp_path):
    _, out, true, time_ns, P = cell
    kept = np.random.default_rng(0).random(len(P)) > 0.05
    middle = time_ns[0] + (time_ns[-1] - time_ns[0]) // 2
    kept &= (time_ns < middle) | (time_ns > middle + 2_000_000_000)
    build(
        BuildConfig(
            write_power(tmp_path / "p.csv", time_ns[kept], P[kept]), out / "logs", tmp_path / "ds", "iiwa7_r800"
        ),
        lambda what, share: None,
    )
    manifest = load_manifest(tmp_path / "ds")
    whole = sum(entry["rows"] for entry in manifest["recordings"]) * 0.04
    valid = sum(entry["valid_s"] for entry in manifest["recordings"])
    assert whole - 2.5 < valid < whole
    assert all(abs(entry["lag_s"] - true[entry["name"]]) < 0.008 for entry in manifest["recordings"])


def test_logs_without_power_and_a_stuck_meter_are_refused(cell, tmp_path):
    settings, out, true, time_ns, P = cell
    paths = sorted((out / "logs").rglob("*.log"))
    half = time_ns < time_ns[0] + (time_ns[-1] - time_ns[0]) // 2
    power = write_power(tmp_path / "half.csv", time_ns[half], P[half])
    report = build(BuildConfig(power, out / "logs", tmp_path / "ds", "iiwa7_r800"), lambda what, share: None)
    assert 2 <= len(report.refused) == 8 - report.recordings  # of the last, what has power may stay
    assert all(abs(e["lag_s"] - true[e["name"]]) < 0.01 for e in load_manifest(tmp_path / "ds")["recordings"])
    robot = load_description("iiwa7_r800")
    clock = read_log(paths[3], robot).time - settings.clock.offset_s
    stuck = P.copy()
    stuck[(time_ns * 1e-9 > clock[0] - 1) & (time_ns * 1e-9 < clock[-1] + 1)] = (
        155.0 + 5 * np.sin(np.arange(len(P)))[(time_ns * 1e-9 > clock[0] - 1) & (time_ns * 1e-9 < clock[-1] + 1)]
    )
    power = write_power(tmp_path / "stuck.csv", time_ns, stuck)
    report = build(BuildConfig(power, out / "logs", tmp_path / "d2", "iiwa7_r800"), lambda what, share: None)
    assert len(report.refused) == 1 and paths[3].name in report.refused[0]


def test_mixed_up_columns_are_named(cell, tmp_path):
    _, out, _, _, _ = cell
    folder = tmp_path / "logs"
    folder.mkdir()
    for path in sorted((out / "logs").rglob("*.log"))[:3]:
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
    with pytest.raises(InputError, match="columns in the order"):
        build(BuildConfig(f"{out}/power.sqlite", folder, tmp_path / "ds", "iiwa7_r800"), lambda what, share: None)
    assert not (tmp_path / "ds").exists()


def test_channels_that_come_one_after_the_other_are_told_apart(tmp_path):
    rows_ = [
        f"{1_626_163_200 + 0.04 * k:.3f},{channel},{P + k % 7}"
        for channel, P in (("L1", 50), ("total", 150))
        for k in range(120_000)
    ]
    (tmp_path / "p.csv").write_text("\n".join(["time,channel,P", *rows_, ""]))
    stream = open_power(str(tmp_path / "p.csv"), None, None)
    assert len(stream.P) == 120_000 and stream.P.min() == 150
    assert open_power(str(tmp_path / "p.csv"), None, "L1").P.max() == 56


def test_one_log_cut_into_pieces_is_split_by_its_pieces_many_by_their_source():
    from acqd.dataset.split import sources_of

    assert len(set(sources_of([f"run_p{k:03d}" for k in range(9)]).values())) == 9
    many = [f"all_{k:02d}_{n:04d}_p{p:03d}" for k in range(3) for n in range(4) for p in range(5)]
    assert set(sources_of(many).values()) == {"all_00", "all_01", "all_02"}


@pytest.mark.parametrize(
    ("name", "text", "expected"),
    [
        ("a.parquet", "", "is not a Parquet file"),
        ("a.jsonl", '{"time": null, "P": 1}\n', "row 1 has no time"),
        ("a.jsonl", "[1, 2]\n", "line 1 is not a JSON object"),
        ("a.csv", "filetime,P\n,1\n", "has no time"),
        ("a.csv", "filetime,P\nx,1\n", "column filetime"),
        ("a.sqlite", "", "is empty"),
    ],
)
def test_broken_power_files_are_named(tmp_path, name, text, expected):
    (tmp_path / name).write_text(text)
    with pytest.raises(UserError, match=expected):
        open_power(str(tmp_path / name), None, None)
    assert (tmp_path / name).read_text() == text


def test_the_same_assembly_again_and_again_with_the_peak_of_its_brakes_is_placed(tmp_path):
    """Every execution fits in many places of the stream, and the peak is more than all that motion explains."""
    settings = CampaignSettings(profile="use-case", assemblies=6, session=6, seed=9, clock={"offset_s": 1.24})
    out, truth = tmp_path / "c", tmp_path / "t"
    run_campaign(CampaignConfig(settings, out, truth, f"{out}/power.sqlite", 2), lambda what, share: None)
    report = make(out, tmp_path / "ds")
    assert report.refused == []
    right = true_lags(settings, truth)
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
