"""Logs that are placed, predicted and stored, and logs that are late, renamed, odd or written again."""

import json
import os
import shutil
import sqlite3

import pytest

from acqd.storage.database import open_database
from tests.commands import acqd
from tests.sidecar.cell import BEGIN, CLOCK, cell, motion, power_of, store_power, write_log
from tests.sidecar.runs import counts_of, done_in, run, sidecar


def test_logs_are_placed_predicted_and_stored(tmp_path, bundle, database):
    logs = tmp_path / "logs"
    logs.mkdir()
    cell(logs, database, 3)
    result = acqd(*sidecar(logs, bundle, database, "--no-mqtt", "--until-idle", "--json"))
    assert result.returncode == 0, result.stderr
    assert counts_of(result) == {"done": 3, "refused": 0, "waiting": 0}
    found, counts = done_in(database)
    for name, (status, message) in found.items():
        assert status == "ok"
        assert message["lag_s"] == pytest.approx(CLOCK, abs=0.02)
        assert message["rmse_W"] < 2  # 1.2 W of noise
        assert counts[name] == message["rows"] > 700
    again = run(sidecar(logs, bundle, database, "--no-mqtt", "--until-idle", "--json"))
    assert counts_of(again) == {"done": 0, "refused": 0, "waiting": 0}  # nothing is done twice


def test_what_cannot_be_done_is_named_and_the_rest_goes_on(tmp_path, bundle):
    url, logs = str(tmp_path / "p.sqlite"), tmp_path / "logs"
    logs.mkdir()
    open_database(url)
    cell(logs, url, 2)
    (logs / "log_a.csv").write_text("time,q1,q2\n1,2,3\n")  # another robot's
    write_log(logs / "log_b.csv", motion(800, 77), BEGIN + 9e6)  # no power there
    store_power(url, power_of(motion(900, 50), 50)[:450], BEGIN + 3000, 700_000)  # for half of log_c only
    write_log(logs / "log_c.csv", motion(900, 50), BEGIN + 3000)
    store_power(url, power_of(motion(900, 51), 51)[:800], BEGIN + 4000, 800_000)  # nearly for all of log_d
    write_log(logs / "log_d.csv", motion(900, 51), BEGIN + 4000)
    store_power(url, power_of(motion(300, 52), 52), BEGIN + 5000, 900_000)  # the meter went on
    result = run(sidecar(logs, bundle, url, "--no-mqtt", "--until-idle", "--json", "--patience", "0.5"))
    assert counts_of(result) == {"done": 3, "refused": 2, "waiting": 1}, result.stderr
    assert "log_d.csv: residual" in result.stderr and "could not be compared" in result.stderr
    assert "Traceback" not in result.stderr
    found, _ = done_in(url)
    assert "log_a.csv" in found["log_a.csv"][1]["reason"]
    assert (
        "log_b.csv" not in found and "no power rows up to" in result.stderr
    )  # they may come: the next start asks again
    assert "power rows are missing for" in found["log_c.csv"][1]["reason"]
    assert 0.75 < found["log_d.csv"][1]["covered"] < 0.95 and found["log_000.csv"][1]["covered"] > 0.95


def test_renamed_copied_and_restored_logs_keep_their_rows(tmp_path, bundle):
    url, logs = str(tmp_path / "p.sqlite"), tmp_path / "logs"
    logs.mkdir()
    open_database(url)
    cell(logs, url, 3)
    command = sidecar(logs, bundle, url, "--no-mqtt", "--until-idle", "--json")
    first, second, third = ((logs / f"log_{k:03d}.csv").read_bytes() for k in range(3))
    for path in logs.iterdir():
        path.unlink()
    latest = logs / "latest.csv"
    for number, content in enumerate((first, second, third)):  # as a controller rotates its logs
        if latest.exists():
            latest.rename(logs / f"run_{number - 1}.csv")
        latest.write_bytes(content)
        assert counts_of(run(command))["done"] == 1
    found, counts = done_in(url)
    assert {name: status for name, (status, _) in found.items()} == dict.fromkeys(
        ["latest.csv", "run_0.csv", "run_1.csv"], "ok"
    )
    assert all(counts[name] == message["rows"] for name, (_, message) in found.items())
    latest.write_bytes(second)  # what another file has already
    assert counts_of(run(command))["done"] == 0
    (logs / "run_1.csv").write_bytes(first[: len(first) // 2].rpartition(b"\n")[0] + b"\n")
    assert counts_of(run(command))["done"] == 1
    found, _ = done_in(url)
    assert found["latest.csv"][0] == "ok" and found["run_1.csv"][0] == "ok"  # the copy kept the rows of the original


def test_what_is_no_file_is_left_alone_and_names_stay_apart(tmp_path, bundle):
    url, logs = str(tmp_path / "p.sqlite"), tmp_path / "logs"
    (logs / "archive.log").mkdir(parents=True)
    os.mkfifo(logs / "pipe.log")
    open_database(url)
    cell(logs, url, 2)
    (logs / "log_000.csv").rename(logs / os.fsdecode(b"Gr\xf6e.csv"))
    (logs / "log_001.csv").rename(logs / os.fsdecode(b"Gr\xfce.csv"))
    result = run(sidecar(logs, bundle, url, "--no-mqtt", "--until-idle", "--json"))
    assert counts_of(result)["done"] == 2, result.stderr
    assert {status for status, _ in done_in(url)[0].values()} == {"ok"} and len(done_in(url)[0]) == 2
    (logs / "a\nb.csv").write_text("x\n")
    lines = run(sidecar(logs, bundle, url, "--no-mqtt", "--until-idle")).stderr.strip().splitlines()
    assert sum("a\\nb.csv" in line for line in lines) == 1
    assert all(line.startswith("acqd: ") for line in lines)  # the name does not break its line


def test_refused_logs_are_looked_at_once_more_when_asked(tmp_path, bundle):
    url, logs = str(tmp_path / "p.sqlite"), tmp_path / "logs"
    logs.mkdir()
    open_database(url)
    cell(tmp_path, url, 1, first=5)  # the database has later rows, so those of log_000 are missing, not late
    q = motion(800, 0)
    write_log(logs / "log_000.csv", q, BEGIN)
    command = sidecar(logs, bundle, url, "--no-mqtt", "--until-idle", "--json")
    assert counts_of(run(command))["refused"] == 1
    cell(tmp_path, url, 1)
    assert counts_of(run(command)) == {"done": 0, "refused": 0, "waiting": 0}
    assert counts_of(run([*command, "--retry-refused"]))["done"] == 1


def test_odd_logs_do_not_stop_those_behind_them(tmp_path, bundle):
    url, logs = str(tmp_path / "p.sqlite"), tmp_path / "logs"
    (logs / "sub").mkdir(parents=True)
    open_database(url)
    cell(logs, url, 2)
    lines = (logs / "log_000.csv").read_text().splitlines()
    (logs / "a_brake.csv").write_text("\n".join([lines[0], *(line[:-1] for line in lines[1:])]) + "\n")
    for name, factor in (("a_ms.csv", 1000.0), ("a_far.csv", 1e290)):
        rows = [line.split(",", 1) for line in lines[1:]]
        (logs / name).write_text("\n".join([lines[0], *(f"{float(t) * factor:.6g},{rest}" for t, rest in rows)]) + "\n")
    (logs / os.fsdecode(b"a_pr\xfcf.csv")).write_text("time\n1\n")
    shutil.copy(logs / "log_001.csv", logs / "sub" / "log_000.csv")  # same name, another folder: the same content
    result = run(sidecar(logs, bundle, url, "--no-mqtt", "--until-idle", "--json", "--patience", "0.2"))
    assert result.returncode == 0, result.stderr
    assert counts_of(result) == {"done": 2, "refused": 4, "waiting": 0}
    found, _ = done_in(url)
    assert {name for name, (status, _) in found.items() if status == "ok"} == {"log_000.csv", "log_001.csv"}


def test_a_log_that_was_written_again_takes_the_place_of_the_old_one(tmp_path, bundle):
    url, logs = str(tmp_path / "p.sqlite"), tmp_path / "logs"
    logs.mkdir()
    open_database(url)
    cell(logs, url, 1)
    whole = (logs / "log_000.csv").read_text()
    half = "\n".join(whole.splitlines()[:500]) + "\n"
    (logs / "log_000.csv").write_text(half)
    run(sidecar(logs, bundle, url, "--no-mqtt", "--until-idle"))
    (logs / "log_000.csv").write_text(whole)
    run(sidecar(logs, bundle, url, "--no-mqtt", "--until-idle"))
    with sqlite3.connect(url) as connection:
        rows = dict(connection.execute("SELECT status, message FROM prediction_log").fetchall())
        count = connection.execute("SELECT count(*) FROM prediction").fetchone()[0]
    assert set(rows) == {"ok", "superseded"}
    assert count == json.loads(rows["ok"])["rows"]
