"""Several sources in one daemon: rows apart, a source that is away disturbs nobody, registers of each device."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from acqd.daemon.config_file import load_config
from acqd.daemon.health.query import ask
from acqd.daemon.health.section import HealthSection
from acqd.errors import InputError
from acqd.telemetry.broker import free_port
from acqd.telemetry.spool import Limits, Spool
from tests.commands import ACQD, acqd_here
from tests.waiting import LIMIT_S, wait_for

ONE = '[[source]]\ndevice = "a"\nphases = 1\nvoltage = 120.0\n'
TWO = '[[source]]\ndevice = "b"\nphases = 3\npower = 500.0\n'


def written(folder, text):
    path = folder / "acqd.toml"
    path.write_text(text)
    return path


@contextmanager
def daemon(folder, sources, health=0, **mqtt):
    """`acqd run` with a tape; its rows so far. `health`: port of its endpoints."""
    settings = mqtt or {"enabled": "false"}
    lines = "".join(f"{key} = {value}\n" for key, value in settings.items())
    config = written(
        folder,
        f'device = "pc"\nstate_dir = "{folder}"\n[health]\nport = {health}\nsink_port = 0\n[mqtt]\n{lines}{sources}',
    )
    tape, log = folder / "tape", folder / "log"
    tape.unlink(missing_ok=True)
    with log.open("a") as stderr:
        command = [*ACQD, "run", "--config", str(config), "--tape", str(tape)]
        process = subprocess.Popen(command, stderr=stderr, stdout=subprocess.DEVNULL)

    def rows(device):
        lines = tape.read_text().splitlines() if tape.exists() else []
        return [
            row for row in map(json.loads, (line for line in lines if line.endswith("}"))) if row["device"] == device
        ]

    try:
        yield process, rows, log
    finally:
        process.kill()
        process.wait(LIMIT_S)


def test_boxes_have_their_rows_and_one_that_is_away_is_fetched_when_it_comes(tmp_path):
    late = tmp_path / "late.npz"
    away = f'[[source]]\ndevice = "c"\nkind = "replay"\nfile = "{late}"\n'
    with daemon(tmp_path, ONE + TWO + away) as (process, rows, log):
        wait_for(lambda: len(rows("a")) > 10 and len(rows("b")) > 40, "rows of the boxes that are there")
        assert f"source of c: {late}: no such file" in log.read_text() and not rows("c")
        t = np.arange(20_000) / 20_000
        wave = np.round(1e4 * np.sin(2 * np.pi * 50 * t)).astype(np.int16)[None]
        np.savez(tmp_path / "made", u_code=wave, i_code=wave, u_V_per_digit=0.0325, i_A_per_digit=1e-4, fs=20_000)
        (tmp_path / "made.npz").rename(late)
        wait_for(lambda: len(rows("c")) > 10, "rows of the box that came late")
        before = len(rows("b"))
        wait_for(lambda: len(rows("b")) > before + 40, "the others go on, also when a recording has ended")
        process.send_signal(signal.SIGTERM)
        assert process.wait(LIMIT_S) == 0
    assert {row["channel"] for row in rows("a")} == {"L1"} and len({row["channel"] for row in rows("b")}) == 4
    calm = [row for row in rows("a") if row["flags"] == ["simulated"]]
    assert all(abs(row["Vrms"] - 120) < 3 for row in calm)
    assert abs(np.mean([row["P"] for row in rows("c")]) - 325 / 2) < 0.1
    assert len({rows(device)[0]["boot"] for device in "abc"}) == 3
    assert "source of c: delivers" in log.read_text() and "Traceback" not in log.read_text()


def children(pid):
    return [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


def main_fast(pid):
    """Processes of MAIN_FAST: a process that the daemon starts for several boxes forks them."""
    (nursery,) = children(pid)
    return children(nursery)


def test_health_is_said_of_each_box(tmp_path):
    away = '[[source]]\ndevice = "c"\nkind = "replay"\nfile = "nowhere.npz"\n'
    section = HealthSection(port=free_port(), sink_port=0)
    with daemon(tmp_path, ONE + TWO + away, health=section.port) as (process, rows, log):
        wait_for(lambda: len(rows("a")) > 10 and len(rows("b")) > 40, "rows of the boxes that are there")
        answer = ask(section, "daemon")
        assert not answer.ready and answer.problems == ["source of c away: nowhere.npz: no such file"]
        boxes = {box["name"]: box for box in answer.status["boxes"]}
        assert [boxes[name]["source"]["connected"] for name in "abc"] == [True, True, False]
        assert boxes["b"]["windows"]["made"] > 9 and boxes["b"]["windows"]["flags"]["start"] == 1
        assert boxes["c"]["windows"]["made"] == 0 and boxes["c"]["devices"] == ["c"]
        told = acqd_here("status", "--config", str(tmp_path / "acqd.toml"))
        lines = {line.split()[1]: line for line in told.stdout.splitlines() if line.startswith("│ ")}
        assert told.returncode == 1 and "away" in lines["c"] and "delivers" in lines["a"]
        os.kill(main_fast(process.pid)[0], signal.SIGKILL)
        wait_for(lambda: "delivers again" in log.read_text(), "MAIN_FAST is back")
        after = ask(section, "daemon")
        (named,) = [note for note in after.notes if note.startswith("MAIN_FAST")]
        restarts = {box["name"]: box["cycles"]["restarts"] for box in after.status["boxes"] if box["cycles"]}
        killed = named.split()[2]
        assert named == f"MAIN_FAST of {killed} was relaunched once" and restarts == {"a": 0, "b": 0} | {killed: 1}
        assert f"MAIN_FAST of {killed}: signal 9" in log.read_text()


def spooled(folder, device):
    """W of L1 in all rows of a device that are in the spool."""
    copy = folder / "copy"
    shutil.rmtree(copy, ignore_errors=True)
    shutil.copytree(next(folder.glob("spool-*")), copy)
    spool = Spool(copy, Limits())
    rows, position = [], spool.start
    while position != spool.end:
        some, position = spool.read(position, 1_000, lambda *_: True)
        rows += some
    spool.close()
    return [json.loads(payload)["W"] for stream, _, payload in rows if stream[:2] == (device, "L1")]


def test_a_register_of_each_device_continues_after_a_kill(tmp_path):
    with daemon(tmp_path, ONE + TWO, port=free_port()) as (_, rows, _log):
        wait_for(lambda: len(rows("a")) > 30 and len(rows("b")) > 120, "rows")
    last = {device: spooled(tmp_path, device)[-1] for device in "ab"}  # windows in progress may be on the tape alone
    window = {device: last[device] / len(spooled(tmp_path, device)) for device in "ab"}
    (tmp_path / "energy-a.json").unlink(missing_ok=True)
    (tmp_path / "energy-b.json").unlink(missing_ok=True)  # the spool knows them, too
    with daemon(tmp_path, ONE + TWO, port=free_port()) as (_, rows, _log):
        wait_for(lambda: rows("a") and rows("b"), "rows after the restart")
        begun = {device: rows(device)[0]["W"] for device in "ab"}
    assert all(last[device] < begun[device] < last[device] + 2 * window[device] for device in "ab"), (last, begun)


def test_a_daemon_stops_while_a_box_is_waited_for(tmp_path):
    away = '[[source]]\ndevice = "c"\nkind = "replay"\nfile = "nowhere.npz"\n'
    with daemon(tmp_path, ONE + away) as (process, rows, log):
        wait_for(lambda: len(rows("a")) > 3, "rows of the other box")
        process.send_signal(signal.SIGTERM)
        assert process.wait(LIMIT_S) == 0
    assert "Traceback" not in log.read_text() and "trying again" in log.read_text()


def test_a_setting_that_does_not_fit_a_source_ends_the_daemon(tmp_path):
    wrong = 'wiring = "aron"\n'
    path = written(tmp_path, "[mqtt]\nenabled = false\n" + ONE + wrong + TWO)
    done = acqd_here("run", "--config", str(path), "--duration", "30")
    assert done.returncode == 2 and "source of a: source: wiring" in done.stderr and "2 phases" not in done.stderr


def test_no_source_at_all_ends_the_daemon(tmp_path):
    gone = "".join(f'[[source]]\ndevice = "{name}"\nkind = "replay"\nfile = "{name}.npz"\n' for name in "ab")
    done = acqd_here("run", "--config", str(written(tmp_path, "[mqtt]\nenabled = false\n" + gone)))
    assert done.returncode == 2 and "no source can be used; a: a.npz: no such file" in done.stderr


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("[[source]]\nphases = 1\n", "source 1: device is missing"),
        (ONE + ONE, "two sources have the device 'a'"),
        (ONE + '[[source]]\ndevice = "b/c"\n', "source 2: device 'b/c': expected"),
        (ONE + TWO + "voltages = 3\n", "source 2: unknown key source.voltages; did you mean source.voltage"),
        (ONE + '[[source]]\ndevice = "b"\nkind = "ads"\n', "source 2: source.host is missing"),
        (ONE + '[[source]]\ndevice = "b"\nkind = "radio"\n', "source 2: source.kind: 'radio' is unknown"),
        ("source = [1]\n", "source 1"),
        (ONE * 65, "sources: expected at most 64 items, not 65"),
        (ONE + "[source]\nphases = 1\n", "several sources are all written as [[source]]"),
        (ONE + "correction = { igain = [1.0] }\n", "did you mean source.correction.i_gain"),
        ("[[boxes]]\ndevice = 'a'\n", "written as [[source]]"),
        ("[[sources]]\ndevice = 'a'\n", "unknown key sources; several sources are written as [[source]]"),
    ],
)
def test_mistakes_name_the_source(tmp_path, text, complaint):
    with pytest.raises(InputError) as error:
        load_config(written(tmp_path, text))
    assert complaint in str(error.value)


def test_meters_and_boxes_can_share_a_daemon(tmp_path):
    meters = '[[source]]\nkind = "meters"\nhost = "10.0.0.9"\nmeters = [{name = "m1", profile = "sdm630"}]\n'
    assert load_config(written(tmp_path, ONE + meters)).devices == ["a", "m1"]
    with pytest.raises(InputError, match="source 1: device: the rows of meters"):
        load_config(written(tmp_path, meters.replace("[[source]]", '[[source]]\ndevice = "x"')))
