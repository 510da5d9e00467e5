"""The sidecar with a real database and a real broker: logs that arrive, break, repeat; kills; the alarm; live rows."""

import asyncio
import json
import os
import random
import shutil
import signal
import sqlite3
import subprocess
import sys
import time
from dataclasses import replace

import numpy as np
import orjson
import paho.mqtt.client as paho
import pytest
from paho.mqtt.enums import CallbackAPIVersion
from scipy.signal import lfilter

from acqd.dataset.align import Lag
from acqd.models import features
from acqd.models.bundle.bundle import save_bundle
from acqd.models.bundle.envelope import Envelope
from acqd.models.bundle.reference import reference_arrays
from acqd.models.predictor import Stream
from acqd.models.segments import Segment
from acqd.sidecar.clock_memory import ClockMemory
from acqd.sidecar.live import Live
from acqd.sidecar.lock import exclusive
from acqd.sidecar.log_arrivals import Arrivals
from acqd.sidecar.power_rows import PowerRowsMissingError
from acqd.sidecar.service import Sidecar
from acqd.sidecar.settings import Settings
from acqd.sidecar.store import Done, Store
from acqd.sidecar.worker import Worker
from acqd.storage.database import open_database
from acqd.storage.writer import Received, Writer
from acqd.telemetry import topics
from tests.builders import AXES, STEP, grey, grey_bundle
from tests.conftest import wait_for

ACQD = [sys.executable, "-m", "acqd"]
BEGIN = 1_700_000_000.0
CLOCK = 1.3  # s that the robot's clock is ahead


def motion(rows, seed):
    """Rest, smooth motion, rest."""
    chance = np.random.default_rng(seed)
    t = np.arange(rows) * STEP
    q = np.zeros((rows, AXES))
    for _ in range(3):
        rate, phase, size = chance.uniform(0.1, 0.4, AXES), chance.uniform(0, 6, AXES), chance.uniform(0.2, 0.5, AXES)
        q += size * np.sin(2 * np.pi * rate * t[:, None] + phase)
    k = np.arange(rows)
    ease = np.clip(np.minimum(k - 50, rows - 50 - k) / 60, 0, 1)[:, None]
    return q[50] + ease**3 * (10 - 15 * ease + 6 * ease**2) * (q - q[50])


def power_of(q, seed, extra=0.0):
    """What a meter sees."""
    noise = lfilter([0.3], [1, -0.7], np.random.default_rng(seed).normal(0, 1, len(q)))
    return grey().sequence(q, np.ones((len(q), 1))) + noise + extra


def write_log(path, q, begin_s):
    """Generic CSV at 25 Hz, the robot's clock."""
    t = begin_s + CLOCK + STEP * np.arange(len(q))
    tau = grey().motor_torque(*features.motion(q, STEP))[0]
    names = [f"{quantity}{k + 1}" for quantity in ("q", "tau") for k in range(AXES)]
    lines = [",".join(["time", *names, "brake"])]
    rows = np.column_stack([q, tau])
    lines += [f"{stamp:.4f}," + ",".join(f"{v:.6f}" for v in row) + ",1" for stamp, row in zip(t, rows, strict=True)]
    path.write_text("\n".join(lines) + "\n")


def store_power(url, P, begin_s, first=0):
    """Rows as the sink writes them; windows begin half a row before the log's samples."""
    messages = []
    for k, value in enumerate(P):
        ns = round((begin_s + STEP * (k - 0.5)) * 1e9)
        row = {
            "device": "cell", "channel": "L1", "boot": "b", "seq": first + k, "time": rfc3339(ns), "schema": 1,
            "filetime": ns // 100 + 116_444_736_000_000_000, "Vrms": 230.0, "Irms": 1.0, "P": float(value),
            "S": float(value), "PF": 1.0, "f": 50.0, "W": 0.0, "flags": [],
        }  # fmt: skip
        messages.append(Received(topics.power("cell", "L1"), orjson.dumps(row)))
    written = Writer(open_database(url)).write(messages)
    assert written.rows == len(P), written


def rfc3339(ns):
    from acqd.telemetry.row import rfc3339 as text

    return text(ns)


def cell(folder, url, count, extra=0.0, rows=800, first=0):
    """`count` logs in `folder`, their power in the database."""
    for number in range(first, first + count):
        begin, q = BEGIN + 60.0 * number, motion(rows, number)
        padded = np.concatenate([np.repeat(q[:1], 100, axis=0), q, np.repeat(q[-1:], 100, axis=0)])
        store_power(url, power_of(padded, number, extra), begin - 100 * STEP, 10_000 * number)
        write_log(folder / f"log_{number:03d}.csv", q, begin)


@pytest.fixture
def bundle(tmp_path):
    """With recordings to compare with."""
    segments = []
    for number in range(900, 912):
        q = motion(1000, number)
        P = power_of(q, number)
        segments.append(
            Segment(
                f"r{number}", f"r{number}", "r", "test", q, P, None, {"brake": np.ones(1000)}, BEGIN - 1e6 + number * 60
            )
        )
    envelope = Envelope.of(segments, STEP).as_json()
    path = tmp_path / "bundle"
    save_bundle(path, grey_bundle(reference_arrays(segments), envelope=envelope))
    return path


def sidecar(logs, bundle, url, *more):
    return [*ACQD, "sidecar", str(logs), "--model", str(bundle), "--database", url, "--device", "cell", *more]


def run(command):
    return subprocess.run(command, capture_output=True, text=True, check=False, timeout=100)


def counts_of(result):
    """The last line; before it comes one for each log."""
    *logs, counts = map(json.loads, result.stdout.splitlines())
    assert len(logs) == counts["done"] + counts["refused"] and all(each["status"] in ("ok", "refused") for each in logs)
    return counts


def done_in(url):
    store = Store(open_database(url))
    with store.engine.connect() as connection:
        rows = connection.exec_driver_sql("SELECT name, status, message FROM prediction_log ORDER BY name").all()
        counts = dict(
            connection.exec_driver_sql(
                "SELECT name, count(*) FROM prediction JOIN prediction_log USING (sha256) GROUP BY name"
            ).all()
        )
    return {
        name: (status, message if isinstance(message, dict) else json.loads(message)) for name, status, message in rows
    }, counts


def test_logs_are_placed_predicted_and_stored(tmp_path, bundle, database):
    logs = tmp_path / "logs"
    logs.mkdir()
    cell(logs, database, 3)
    result = run(sidecar(logs, bundle, database, "--no-mqtt", "--until-idle", "--json"))
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
    told = run(sidecar(logs, bundle, url, "--no-mqtt", "--until-idle")).stderr.strip()
    assert "a\\nb.csv" in told and len(told.splitlines()) == 1


def test_one_sidecar_a_database_and_one_device(tmp_path, bundle, database):
    logs = tmp_path / "logs"
    logs.mkdir()
    cell(logs, database, 1)
    command = sidecar(logs, bundle, database, "--no-mqtt", "--until-idle")
    with exclusive(open_database(database)):
        second = run(command)
    assert second.returncode == 2 and "another sidecar works on this database" in second.stderr
    assert run(command).returncode == 0
    with open_database(database).begin() as connection:
        connection.exec_driver_sql("UPDATE power SET device = 'other' WHERE seq < 100")
    without = [word for word in command if word not in ("--device", "cell")]
    several = run([word if word != "cell" else "cell" for word in without])
    assert several.returncode == 2 and "choose one with --device: cell, other" in several.stderr


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


def test_power_that_comes_late_is_waited_for(tmp_path, bundle):
    url, logs = str(tmp_path / "p.sqlite"), tmp_path / "logs"
    logs.mkdir()
    engine = open_database(url)
    worker = Worker(Settings(bundle, url, None, None, 0.3), engine)
    q = motion(800, 0)
    write_log(logs / "a.csv", q, BEGIN)
    with pytest.raises(PowerRowsMissingError, match="no power rows up to"):
        worker.run(logs / "a.csv", "a.csv", "x")
    cell(logs, url, 1)
    assert worker.run(logs / "a.csv", "a.csv", "x").status == "ok"


def test_the_clocks_line_holds_for_more_logs_than_it_remembers_and_begins_anew_when_it_was_set():
    clock = ClockMemory()
    located = []
    for number in range(45):
        middle = 3600.0 * number
        lag = 1.0 + 20e-6 * middle + (2.0 if number >= 38 else 0.0)
        seconds, how = clock.place(middle, Lag(lag, 0.9, 3.0))
        located.append((seconds - lag, how))
    assert max(abs(off) for off, _ in located) < 1e-3
    assert located[37][1] == "clock line" and located[38][1] == "own" and located[-1][1] == "clock line"


def test_another_model_begins_the_drift_anew(tmp_path, bundle):
    engine = open_database(str(tmp_path / "p.sqlite"))
    first = Worker(Settings(bundle, "", None, None), engine)
    first.drift.monitor.sums[:] = 7.0
    other = tmp_path / "other"
    shutil.copytree(bundle, other)
    (other / "bundle.json").write_text((bundle / "bundle.json").read_text().replace('"trial"', '"trial 2"'))
    again, changed = (Worker(Settings(path, "", None, None), engine) for path in (bundle, other))
    again.restore(first.memory())
    changed.restore(first.memory())
    assert again.drift.monitor.sums.max() == 7.0 and changed.drift.monitor.sums.max() == 0.0
    again.restore({"model": first.memory()["model"], "lags": [[1]], "monitor": {}})  # of an earlier version


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


def test_half_written_files_are_waited_for(tmp_path):
    arrivals = Arrivals(tmp_path, settle_s=0.2)
    path = tmp_path / "a.log"
    path.write_text("time,q1\n1,2")
    (tmp_path / ".a.log.part").write_text("x\n")
    for _ in range(4):
        time.sleep(0.1)
        assert list(arrivals.look()) == []  # ends within a line
    with path.open("a") as file:
        file.write("\n")
    assert list(arrivals.look()) == []
    assert arrivals.waiting()
    time.sleep(0.3)
    assert list(arrivals.look()) == [path]
    assert list(arrivals.look()) == []
    path.unlink()
    assert list(arrivals.look()) == [] and not arrivals.waiting()
    empty = tmp_path / "b.log"
    empty.touch()
    assert list(arrivals.look()) == [] and arrivals.waiting()  # somebody is about to write it
    os.utime(empty, (time.time() - 60, time.time() - 60))
    assert list(arrivals.look()) == [empty]


def test_every_log_is_done_exactly_once_whoever_is_killed(tmp_path, bundle, mosquitto):
    url, logs, coming = str(tmp_path / "p.sqlite"), tmp_path / "logs", tmp_path / "coming"
    logs.mkdir()
    coming.mkdir()
    open_database(url)
    cell(coming, url, 4, rows=500)
    heard = []
    listener = paho.Client(CallbackAPIVersion.VERSION2)
    listener.on_connect = lambda c, *_: c.subscribe("acqd/cell/prediction", qos=1)
    listener.on_message = lambda _c, _d, message: heard.append(json.loads(message.payload))
    listener.connect("127.0.0.1", mosquitto.port)
    listener.loop_start()
    chance = random.Random(3)
    names = sorted(coming.iterdir())
    for number in range(4):
        process = subprocess.Popen(
            sidecar(logs, bundle, url, "--port", str(mosquitto.port)),
            stderr=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
        )
        shutil.move(names[number], logs / names[number].name)
        time.sleep(chance.uniform(1.5, 5.0))
        process.send_signal(signal.SIGKILL)
        process.wait()
    last = run(sidecar(logs, bundle, url, "--port", str(mosquitto.port), "--until-idle"))
    assert last.returncode == 0, last.stderr
    found, counts = done_in(url)
    assert sorted(found) == [path.name for path in names]
    assert all(status == "ok" and counts[name] == message["rows"] for name, (status, message) in found.items())
    wait_for(lambda: {each["log"] for each in heard} == set(found), "every log was published")
    listener.loop_stop()


def test_a_change_raises_the_alarm_on_the_broker_and_is_kept(tmp_path, bundle, mosquitto):
    url, logs = str(tmp_path / "p.sqlite"), tmp_path / "logs"
    logs.mkdir()
    open_database(url)
    cell(logs, url, 7)
    cell(logs, url, 4, extra=6.0, first=7)
    result = run(sidecar(logs, bundle, url, "--port", str(mosquitto.port), "--until-idle"))
    assert "the residual has changed" in result.stderr
    kept = []
    client = paho.Client(CallbackAPIVersion.VERSION2)
    client.on_connect = lambda c, *_: c.subscribe("acqd/cell/prediction/alarm", qos=1)
    client.on_message = lambda _c, _d, message: kept.append(json.loads(message.payload))
    client.connect("127.0.0.1", mosquitto.port)
    client.loop_start()
    wait_for(lambda: kept, "the alarm is retained")
    client.loop_stop()
    assert abs(kept[0]["onset_s"] - (BEGIN + 420)) < 70
    found, _ = done_in(url)
    assert [message["drift"] for _, message in found.values()][-1] == "alarm"
    assert sum(message["alarm"] is not None for _, message in found.values()) == 1


def test_nothing_of_a_log_stays_when_it_cannot_be_committed_whole(tmp_path):
    store = Store(open_database(str(tmp_path / "s.sqlite")))
    stamps = np.array([1, 2, 2])  # the key refuses the third
    bad = Done("a", "a.log", "m", "ok", {}, stamps, np.zeros(3), np.zeros(3))
    with pytest.raises(Exception, match="UNIQUE"):
        store.commit(bad, {"sidecar": {"x": 1}})
    assert store.status("a") is None and store.memory("sidecar") is None
    store.commit(replace(bad, filetime=np.array([1, 2, 3])), {"sidecar": {"x": 1}})
    assert store.status("a") == "ok" and store.memory("sidecar") == {"x": 1}


def test_live_rows_are_predicted_as_the_model_says_and_bad_ones_counted():
    model = grey()
    live = Live(model, "joints", "power")
    q = motion(200, 5)
    stream = Stream(model)
    for row, angles in enumerate(q):
        answer = live.answer(orjson.dumps({"time": BEGIN + STEP * row, "q": angles.tolist(), "brake": 1}))
        wanted = stream.step(angles, np.ones(1))
        assert (answer is None) == (wanted is None)
        if answer is not None:
            assert json.loads(answer)["P_predicted"] == pytest.approx(wanted)
    for bad in (b"{", b'{"time": 1}', b'{"time": 1, "q": [1, 2]}', b'{"time": 1, "q": "x"}'):
        assert live.answer(bad) is None
    assert live.refused == 4
    assert live.answer(orjson.dumps({"time": BEGIN + STEP * 200, "q": [1e300] * 6, "brake": 1})) is None
    assert live.answer(orjson.dumps({"time": BEGIN + STEP * 201, "q": [0.0] * 6, "brake": 1})) is None
    assert live.refused == 5  # no number came of it, and the model must not remember it
    after_a_gap = live.answer(orjson.dumps({"time": BEGIN + 1000.0, "q": q[0].tolist()}))
    assert after_a_gap is None  # begins anew


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (("none", "--model", "bundle", "--database", "p.sqlite"), "none is not a folder"),
        (("logs", "--model", "logs", "--database", "p.sqlite"), "no bundle"),
        (("logs", "--model", "bundle", "--database", "x.sqlite"), "does not exist"),
        (("logs", "--model", "bundle", "--database", "p.sqlite", "--live", "--no-mqtt"), "--no-mqtt"),
    ],
)
def test_bad_arguments_are_one_line(tmp_path, bundle, words, told):
    (tmp_path / "logs").mkdir()
    open_database(str(tmp_path / "p.sqlite"))
    result = subprocess.run(
        [*ACQD, "sidecar", *words, "--until-idle"], capture_output=True, text=True, check=False, cwd=tmp_path
    )
    assert result.returncode == 2 and told in result.stderr
    assert len([line for line in result.stderr.splitlines() if "warning" not in line.lower()]) == 1, result.stderr


def test_a_log_that_is_taken_away_while_its_power_is_waited_for_is_forgotten(tmp_path, bundle):
    url, logs = str(tmp_path / "p.sqlite"), tmp_path / "logs"
    logs.mkdir()
    engine = open_database(url)
    write_log(logs / "a.csv", motion(800, 0), BEGIN)
    service = Sidecar(
        logs, Worker(Settings(bundle, url, None, None, 0.0), engine), Store(engine), None, "c", live=False
    )

    async def take_twice():
        await service._read(logs / "a.csv")
        await service._take(logs / "a.csv")
        assert list(service._late) == [logs / "a.csv"]
        (logs / "a.csv").unlink()
        await service._take(logs / "a.csv")

    asyncio.run(take_twice())
    assert not service._late
