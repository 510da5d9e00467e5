"""`acqd replay` as a user runs it."""

from __future__ import annotations

import json
import re
import sqlite3
import subprocess

import numpy as np
import pytest

from tests.commands import ACQD, acqd, acqd_here, refused
from tests.sources.files import write_csv
from tests.waiting import LIMIT_S, wait_for


def test_replay_writes_rows_that_agree_with_the_reference(tmp_path, waveforms):
    folder = waveforms / "microwave_1ph_20k"
    result = acqd_here(
        "replay", folder / "replay_20k_el3783.npz", "--mode", "fixed", "--out", "r.jsonl", "--json", cwd=tmp_path
    )
    assert result.returncode == 0, result.stderr
    rows = [json.loads(line) for line in (tmp_path / "r.jsonl").read_text().splitlines()]
    reference = np.genfromtxt(folder / "ref_40ms.csv", delimiter=",", names=True)
    np.testing.assert_allclose([row["Vrms"] for row in rows], reference["U_fix"], rtol=1e-6)
    np.testing.assert_allclose([row["W"] * 1000 for row in rows], reference["E_Wh"], rtol=1e-6)
    assert [row["seq"] for row in rows] == list(range(325))
    assert json.loads(result.stdout)["rows"] == 325


def test_replay_of_several_files_keeps_keys_unique_and_recorded_time(tmp_path, waveforms):
    source = waveforms / "generator_3ph" / "source" / "test3.cfg"
    write_csv(tmp_path / "a.csv", t0=1_700_000_000.0)
    result = acqd("replay", source, "a.csv", "--out", "-", cwd=tmp_path)
    rows = [json.loads(line) for line in result.stdout.splitlines()]
    assert rows[0]["time"].startswith("2007-06-25T19:13:57.78") and rows[-10]["time"].startswith("2023-11-14T22:13:20")
    keys = [(row["channel"], row["boot"], row["seq"]) for row in rows]
    assert len(set(keys)) == len(keys)


def test_replay_in_real_time_gives_the_same_rows(tmp_path):
    write_csv(tmp_path / "a.csv", rows=10_000)
    options = ["a.csv", "--start", "2021-07-13T10:15:00Z", "--out"]
    assert acqd_here("replay", *options, "max.jsonl", "--quality", "max.quality", cwd=tmp_path).returncode == 0
    result = acqd("replay", *options, "real.jsonl", "--speed", "1", "--quality", "real.quality", cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    fast, real = (
        [json.loads(line) for line in (tmp_path / f"{name}.jsonl").read_text().splitlines()] for name in ("max", "real")
    )
    assert len(fast) == 25 and fast[0]["time"] == "2021-07-13T10:15:00.000000Z"
    # A machine that is busy for longer than MAIN_FAST can catch up loses samples and says so; the other rows are equal.
    whole = [row for row in real if "gap" not in row["flags"]]
    assert len(whole) == 25 or len(whole) < len(real)
    same = {row["time"]: row["P"] for row in fast}
    np.testing.assert_allclose([row["P"] for row in whole], [same[row["time"]] for row in whole], rtol=1e-6)
    if len(whole) == 25:
        fast, real = (
            [json.loads(line) | {"boot": ""} for line in (tmp_path / f"{name}.quality").read_text().splitlines()]
            for name in ("max", "real")
        )
        late = [{**one, "flags": []} for one in real]
        assert late == [{**one, "flags": []} for one in fast] and fast[0]["channel"] == "L1"


def test_power_quality_and_aggregates_of_a_recording(tmp_path, waveforms):
    source = waveforms / "merging_unit_3ph" / "replay_20k_el3783.npz"
    words = ["replay", source, "--quality", "q.jsonl", "--aggregate", "a.jsonl", "--nominal-voltage", "57.7"]
    words += ["--start", "2021-07-13T10:15:01Z", "--harmonic-powers"]
    done = acqd_here(*words, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    rows = [json.loads(line) for line in (tmp_path / "q.jsonl").read_text().splitlines()]
    short = [row for row in rows if row["aggregation"] == "10/12"]
    values = [json.loads(line) for line in (tmp_path / "a.jsonl").read_text().splitlines()]
    phases = [row for row in short if row["channel"] != "total"]
    assert len(values) == len(phases) >= 90 and {row["aggregation"] for row in rows} == {"10/12", "150/180"}
    for row, value in zip(phases, values, strict=True):
        assert all(row[key] == value[key] for key in ("device", "channel", "time", "Vrms", "Irms", "P", "f"))
        assert row["P_h"][0] == pytest.approx(row["P1"], rel=1e-9) and row["V_h_angle"][0] is not None
        assert row["V_over"] is None, "400 kV are no deviation from 57.7 V"
    keys = [(row["channel"], row["seq"]) for row in rows]
    assert len(set(keys)) == len(keys)
    assert "--quality FILE" in refused(acqd_here("replay", source, "--harmonic-powers", cwd=tmp_path))
    both = refused(acqd_here("replay", source, "--quality", "x.jsonl", "--aggregate", "x.jsonl", cwd=tmp_path))
    assert "separate files" in both and not (tmp_path / "x.jsonl").exists()


def test_replay_publishes_every_row_to_the_sink(tmp_path, mosquitto, waveforms):
    log = tmp_path / "sink.log"
    words = [*ACQD, "sink", "--database", "s.sqlite", "--port", str(mosquitto.port)]
    with log.open("wb") as stderr:
        sink = subprocess.Popen(words, cwd=tmp_path, stderr=stderr)
    wait_for(lambda: "connected to broker" in log.read_text(), "the sink has subscribed")
    npz = waveforms / "fridge_1ph_20k" / "replay_20k_el3783.npz"
    result = acqd("replay", npz, "--publish", "--port", mosquitto.port, "--device", "fridge", cwd=tmp_path)
    assert result.returncode == 0, result.stderr

    def stored():
        with sqlite3.connect(tmp_path / "s.sqlite") as connection:
            return connection.execute("SELECT count(*) FROM power WHERE device='fridge'").fetchone()[0]

    wait_for(lambda: stored() == 475, "475 rows in SQL")
    sink.terminate()
    assert sink.wait(LIMIT_S) == 0, log.read_text()
    assert re.search(
        r"disk: .* GB free at .*: rows of 1 device for [0-9.]+ days; they stay for 30 days", log.read_text()
    )


def test_broken_input_leaves_no_output_behind(tmp_path):
    write_csv(tmp_path / "good.csv")
    (tmp_path / "bad.csv").write_text("time,u1,i1\n0,1,2\n0.0001,x,2\n")
    message = refused(acqd_here("replay", "good.csv", "bad.csv", "--out", "r.jsonl", cwd=tmp_path))
    assert "bad.csv: row 3, column 2" in message
    assert sorted(path.name for path in tmp_path.iterdir()) == ["bad.csv", "good.csv"]


def test_synchrophasors_and_half_cycles_of_a_recording_are_lines(tmp_path):
    t = np.arange(20_000) / 20_000.0
    columns = [f(2 * np.pi * (50 * t - k / 3)) for k in range(3) for f in (lambda a: 325 * np.cos(a), np.cos)]
    names = [f"{letter}{k}" for k in (1, 2, 3) for letter in "ui"]
    file, out = tmp_path / "wave.csv", tmp_path / "phasors.jsonl"
    np.savetxt(file, np.column_stack((t, *columns)), delimiter=",", header="t," + ",".join(names), comments="")
    done = acqd_here("replay", file, "--phasors", out, "--start", "2026-11-16T08:00:00Z")
    assert done.returncode == 0, done.stderr
    lines = [json.loads(line) for line in out.read_text().splitlines()]
    assert len(lines) > 40 and lines[0]["f"] == pytest.approx(50, abs=1e-3)
    assert lines[0]["L1"]["V"] == pytest.approx(325 / np.sqrt(2), rel=1e-3)
    assert lines[5]["L2"]["V_angle"] == pytest.approx(-120, abs=0.1) and abs(lines[5]["positive"]["V_angle"]) < 0.1
    done = acqd_here("replay", file, "--half-cycles", tmp_path / "half.jsonl", "--start", "2026-11-16T08:00:00Z")
    halves = [json.loads(line) for line in (tmp_path / "half.jsonl").read_text().splitlines()]
    assert len(halves) > 280 and {one["channel"] for one in halves} == {"L1", "L2", "L3"}
    assert all(abs(one["Urms"] - 325 / np.sqrt(2)) < 0.2 and abs(one["duration"] - 0.02) < 1e-4 for one in halves)
    assert halves[0]["time"].startswith("2026-11-16T08:00:00.0")
    done = acqd_here("replay", file, "--phasors", out, "--out", out)
    assert done.returncode == 2 and "need separate files" in done.stderr
