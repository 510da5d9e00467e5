"""The commands as a user types them."""

from __future__ import annotations

import json
import os
import shutil
import signal
import sqlite3
import subprocess
import sys
import time

import numpy as np
import pytest

from acqd.telemetry.broker import EmbeddedBroker, free_port

from .conftest import wait_for
from .test_sources import write_csv

ACQD = [sys.executable, "-m", "acqd"]


def acqd(*arguments, cwd, timeout=60, **environment):
    result = subprocess.run(
        [*ACQD, *map(str, arguments)], cwd=cwd, capture_output=True, timeout=timeout, check=False,
        env=os.environ | environment,
    )  # fmt: skip
    result.stdout, result.stderr = result.stdout.decode(), result.stderr.decode()
    return result


def refused(result):
    """Exit 2 and one clear line, no traceback."""
    assert result.returncode == 2, result.stderr
    assert "Traceback" not in result.stderr
    lines = result.stderr.strip().splitlines()
    assert len(lines) == 1 and lines[0].startswith("acqd: "), result.stderr
    return lines[0]


def start(*arguments, cwd):
    return subprocess.Popen([*ACQD, *map(str, arguments)], cwd=cwd, stdout=subprocess.PIPE, stderr=subprocess.PIPE)


def test_every_command_has_help_with_an_example_and_json(tmp_path):
    for command in (
        ["run"],
        ["replay"],
        ["sink"],
        ["sink", "maintain"],
        ["watch"],
        ["doctor"],
        ["jitter"],
        ["broker"],
        ["ethercat", "scan"],
        ["modbus", "probe"],
    ):
        result = acqd(*command, "--help", cwd=tmp_path, COLUMNS="200")
        assert result.returncode == 0 and "Example:" in result.stdout and "--json" in result.stdout, command


def test_replay_writes_rows_that_agree_with_the_reference(tmp_path, waveforms):
    folder = waveforms / "microwave_1ph_20k"
    result = acqd(
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
    assert acqd("replay", *options, "max.jsonl", cwd=tmp_path).returncode == 0
    result = acqd("replay", *options, "real.jsonl", "--speed", "1", cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    fast, real = (
        [json.loads(line) for line in (tmp_path / f"{name}.jsonl").read_text().splitlines()] for name in ("max", "real")
    )
    assert len(real) == 25 and [row["time"] for row in real] == [row["time"] for row in fast]
    assert real[0]["time"] == "2021-07-13T10:15:00.000000Z"
    np.testing.assert_allclose([row["P"] for row in real], [row["P"] for row in fast], rtol=1e-6)


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
    assert sink.wait(10) == 0, log.read_text()


def test_demonstration_runs_out_of_the_box(tmp_path):
    result = acqd("run", "--duration", "4", "--json", cwd=tmp_path)
    assert result.returncode == 0, result.stderr
    seconds = [json.loads(line) for line in result.stdout.splitlines()]
    assert {s["channel"] for s in seconds} == {"L1", "L2", "L3", "total"}
    assert all("simulated" in s["flags"] and abs(s["Vrms"] - 230) < 1 for s in seconds)
    rows = sqlite3.connect(tmp_path / "acqd.sqlite").execute("SELECT seq FROM power WHERE channel='L1' ORDER BY seq")
    numbers = [seq for (seq,) in rows]
    assert numbers == list(range(len(numbers))) and len(numbers) > 60


def test_sigterm_finishes_the_window_and_exits_0_soon(tmp_path, mosquitto):
    config = tmp_path / "acqd.toml"
    config.write_text(f'device = "cell1"\nstate_dir = "{tmp_path}"\n[mqtt]\nport = {mosquitto.port}\n')
    watcher = start("watch", "--json", "--port", mosquitto.port, "--count", "100", cwd=tmp_path)
    daemon = start("run", "--config", config, cwd=tmp_path)
    out, _ = watcher.communicate(timeout=30)
    rows = [json.loads(line) for line in out.splitlines()]
    assert len(rows) == 100 and {row["device"] for row in rows} == {"cell1"}
    begun = time.monotonic()
    daemon.send_signal(signal.SIGTERM)
    _, err = daemon.communicate(timeout=10)
    assert daemon.returncode == 0 and time.monotonic() - begun < 5, err.decode()
    register = json.loads((tmp_path / "energy-cell1.json").read_text())
    assert len(register["phases"]) == 3 and register["phases"][0]["import_kWh"] > 0
    # W goes on where it was.
    again = start("run", "--config", config, "--duration", "2", "--json", cwd=tmp_path)
    out, err = again.communicate(timeout=30)
    first = json.loads(out.splitlines()[0])
    assert first["W"] > register["phases"][0]["import_kWh"]


def test_config_mistakes_are_exit_2_and_one_line(tmp_path):
    cases = {
        "[metering]\nmod = 'fixed'\n": "did you mean metering.mode",
        "[mqtt]\npassword_file = '/nowhere'\n": "password file",
        "[source]\nkind = 'replay'\nfile = 'none.npz'\n": "no such file",
        "[source]\nkind = 'replay'\nfile = 'none.npz'\nmap = 'x'\n": "source.map",
        "[source]\nkind = 'ethercat'\ninterface = 'nowhere0'\n": "no network interface 'nowhere0'",
        "[source]\nkind = 'sampled-values'\ninterface = 'nowhere0'\n": "no network interface 'nowhere0'",
        "[source]\nkind = 'ads'\nhost = '127.0.0.99'\nams_net_id = '1.2.3.4.1.1'\n": "is the TwinCAT PC on",
        "[source]\nkind = 'modbus'\nserial_port = '/dev/ttyNOWHERE'\n": "there is no /dev/ttyNOWHERE",
        "[source]\nkind = 'meters'\nhost = 'h'\n[[source.meters]]\nname = 'm'\nprofile = 'x'\n": "no profile 'x'",
    }
    for text, complaint in cases.items():
        (tmp_path / "c.toml").write_text(text)
        assert complaint in refused(acqd("run", "--config", "c.toml", "--duration", "1", cwd=tmp_path)), text
    assert "no such file" in refused(acqd("run", "--config", "none.toml", cwd=tmp_path))


@pytest.mark.skipif(os.geteuid() != 0 or shutil.which("setpriv") is None, reason="drops the rights of root by setpriv")
@pytest.mark.parametrize("kind", ["ethercat", "sampled-values"])
def test_a_user_without_the_right_is_told_which_one(kind, tmp_path):
    (tmp_path / "c.toml").write_text(f"[mqtt]\nenabled = false\n[source]\nkind = '{kind}'\ninterface = 'lo'\n")
    command = ["setpriv", "--inh-caps=-all", "--bounding-set=-all", *ACQD, "run", "--config", "c.toml"]
    result = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=60, check=False)
    assert "CAP_NET_RAW" in refused(result)


def test_environment_mistakes_are_named(tmp_path):
    import asyncio

    (tmp_path / "blocked").write_text("a file where a folder should be")
    refused(acqd("replay", "x.npz", "--out", "r.jsonl", cwd=tmp_path))
    write_csv(tmp_path / "a.csv")
    assert "cannot be written" in refused(acqd("replay", "a.csv", "--out", "blocked/r.jsonl", cwd=tmp_path))
    assert "does not exist" in refused(acqd("sink", "--database", "no/where/x.sqlite", cwd=tmp_path))
    assert "--start" in refused(acqd("replay", "a.csv", "--start", "noon", cwd=tmp_path))
    port = free_port()
    assert "does not answer" in refused(acqd("replay", "a.csv", "--publish", "--port", port, cwd=tmp_path))
    assert "is it running" in refused(acqd("watch", "--port", port, cwd=tmp_path))

    async def with_busy_port():
        server = EmbeddedBroker("127.0.0.1", port)
        await server.start()
        config = tmp_path / "c.toml"
        config.write_text(f"[mqtt]\nport = {port}\n[broker]\nembedded = true\n")
        results = [
            await asyncio.to_thread(acqd, *words, cwd=tmp_path)
            for words in (["broker", "--port", port], ["run", "--config", config])
        ]
        await server.stop()
        return results

    for result in asyncio.run(with_busy_port()):
        assert str(port) in refused(result)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.csv", "blocked", "c.toml"]


def test_broken_input_leaves_no_output_behind(tmp_path):
    write_csv(tmp_path / "good.csv")
    (tmp_path / "bad.csv").write_text("time,u1,i1\n0,1,2\n0.0001,x,2\n")
    message = refused(acqd("replay", "good.csv", "bad.csv", "--out", "r.jsonl", cwd=tmp_path))
    assert "bad.csv: row 3, column 2" in message
    assert sorted(path.name for path in tmp_path.iterdir()) == ["bad.csv", "good.csv"]


def test_a_wrong_password_is_exit_2_everywhere(tmp_path, mosquitto):
    mosquitto.stop()
    passwords = mosquitto.folder / "passwords"
    passwords.touch(mode=0o600)
    subprocess.run(["mosquitto_passwd", "-b", passwords, "acqd", "right"], check=True)
    mosquitto.extra = f"allow_anonymous false\npassword_file {passwords}\n"
    mosquitto.start()
    config = tmp_path / "c.toml"
    config.write_text(f"[mqtt]\nport = {mosquitto.port}\nusername = 'acqd'\npassword = 'wrong'\n")
    write_csv(tmp_path / "a.csv")
    for words in (["run"], ["sink"], ["watch"], ["replay", "a.csv", "--publish"]):
        result = acqd(*words, "--config", config, cwd=tmp_path)
        assert "password" in refused_last(result), words


def refused_last(result):
    """Like `refused`, after log lines."""
    assert result.returncode == 2 and "Traceback" not in result.stderr, result.stderr
    return result.stderr.strip().splitlines()[-1]


def test_doctor_and_jitter_speak_json(tmp_path):
    findings = json.loads(acqd("doctor", "--json", cwd=tmp_path).stdout)
    assert {"python", "broker", "database"} <= {finding["check"] for finding in findings}
    report = json.loads(acqd("jitter", "--duration", "1", "--json", cwd=tmp_path).stdout)
    assert sum(report["histogram_us"].values()) == report["cycles"] > 500


@pytest.mark.parametrize("unit", ["acqd", "acqd-sink", "acqd-broker"])
def test_units_are_valid_and_strict(unit, tmp_path):
    import re
    import shutil
    from pathlib import Path

    if shutil.which("systemd-analyze") is None:
        pytest.skip("no systemd here")
    text = (Path(__file__).parents[1] / "systemd" / f"{unit}.service").read_text()
    path = tmp_path / f"{unit}.service"
    # The program is not installed in /opt on this machine: verify with one that exists.
    text = text.replace("/opt/acqd/.venv/bin/acqd", "/bin/true").replace("file:/opt/acqd/README.md", "man:true")
    path.write_text(text)
    verified = subprocess.run(["systemd-analyze", "verify", path], capture_output=True, text=True, check=False)
    assert verified.returncode == 0 and unit not in verified.stderr, verified.stderr
    result = subprocess.run(
        ["systemd-analyze", "security", "--offline=true", path], capture_output=True, text=True, check=False
    )
    if "nrecognized option" in result.stderr:
        pytest.skip("this systemd cannot analyse offline")
    assert float(re.search(r"exposure level.*: ([\d.]+)", result.stdout).group(1)) <= 2.5
