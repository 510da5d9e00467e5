"""`acqd doctor` and `acqd jitter` as a user runs them."""

from __future__ import annotations

import json
import socket
import sqlite3
import subprocess
import threading
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from acqd import compiling
from acqd.daemon.heard import Heard
from acqd.metering import StreamFormat
from acqd.sources.npz_write import npz_bytes
from acqd.sources.waveform import Waveform
from acqd.telemetry.broker import free_port
from tests.commands import acqd, acqd_here
from tests.conftest import Mosquitto
from tests.mains import make_mains


def test_doctor_and_jitter_speak_json(tmp_path):
    findings = json.loads(acqd_here("doctor", "--json", cwd=tmp_path).stdout)
    assert {"python", "broker", "database"} <= {finding["check"] for finding in findings}
    report = json.loads(acqd("jitter", "--duration", "1", "--json", cwd=tmp_path).stdout)
    assert sum(report["histogram_us"].values()) == report["cycles"] > 0


def findings(tmp_path, text):
    (tmp_path / "c.toml").write_text(text)
    done = acqd_here("doctor", "--config", "c.toml", "--json", cwd=tmp_path)
    return {finding["check"]: finding for finding in json.loads(done.stdout)}


def password_broker(folder, name="acqd", password="right"):
    """A mosquitto that wants a password."""
    subprocess.run(["mosquitto_passwd", "-b", "-c", folder / "passwords", name, password], check=True)
    folder.chmod(0o755)
    broker = Mosquitto(folder, free_port(), f"allow_anonymous false\npassword_file {folder}/passwords\n")
    broker.start()
    return broker


def test_doctor_logs_in_for_real(tmp_path):
    broker = password_broker(tmp_path)
    try:
        text = f'[mqtt]\nport = {broker.port}\nusername = "acqd"\npassword = "PASSWORD"\n'
        right = findings(tmp_path, text.replace("PASSWORD", "right"))["broker"]
        assert right["state"] == "ok" and "lets this configuration in as acqd" in right["finding"]
        wrong = findings(tmp_path, text.replace("PASSWORD", "wrong"))["broker"]
        assert wrong["state"] == "fail" and "refuses the login" in wrong["finding"]
        assert "wrong" not in json.dumps(wrong)
    finally:
        broker.stop()


def test_doctor_tells_a_port_that_is_no_broker(tmp_path):
    with socket.create_server(("127.0.0.1", 0)) as server:
        threading.Thread(target=lambda: server.accept()[0].close(), daemon=True).start()
        broker = findings(tmp_path, f"[mqtt]\nport = {server.getsockname()[1]}\n")["broker"]
    assert broker["state"] == "fail" and "hangs up" in broker["finding"]


def test_doctor_writes_nothing_into_the_database(tmp_path):
    with sqlite3.connect(tmp_path / "theirs.sqlite") as connection:
        connection.execute("CREATE TABLE songs (name)")
    connection.close()
    before = (tmp_path / "theirs.sqlite").read_bytes()
    database = findings(tmp_path, '[mqtt]\nenabled = false\n[sink]\ndatabase = "theirs.sqlite"\n')["database"]
    assert database["state"] == "fail" and "another program" in database["finding"]
    assert (tmp_path / "theirs.sqlite").read_bytes() == before
    assert sorted(path.name for path in tmp_path.iterdir()) == ["c.toml", "theirs.sqlite"]


def test_doctor_names_secrets_that_everybody_may_read(tmp_path):
    (tmp_path / "p").write_text("x\n")
    (tmp_path / "p").chmod(0o644)
    text = f'[mqtt]\nport = 1\nusername = "u"\npassword_file = "{tmp_path}/p"\n'
    assert "mqtt.password_file" in findings(tmp_path, text)["secrets"]["finding"]
    (tmp_path / "p").chmod(0o640)
    assert "secrets" not in findings(tmp_path, text)


def test_doctor_says_what_is_compiled_and_what_is_done_without_a_compiler(tmp_path, monkeypatch):
    here = findings(tmp_path, "")
    assert {here[name]["state"] for name in ("metering", "training", "FMU export")} <= {"ok", "warn"}
    monkeypatch.setattr(compiling, "PREBUILT", tmp_path)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "none"))
    monkeypatch.setenv("PATH", "")
    monkeypatch.delenv("CC", raising=False)
    without = findings(tmp_path, "")
    assert "--compute torch" in without["training"]["finding"]
    assert "zig" in without["FMU export"]["finding"]


def test_doctor_names_miswired_transformers_with_what_to_paste(tmp_path, monkeypatch):
    mains = make_mains(50.0, seconds=1.0, phases=3)
    mains.codes[:, 3] *= -1
    waveform = Waveform("box", mains.codes, StreamFormat(20_000.0, tuple(mains.scale)), 0)
    monkeypatch.setattr("acqd.daemon.wiring_check.captured", lambda *_: npz_bytes(waveform))
    done = acqd_here("doctor", "--wiring", "--seconds", "1", cwd=tmp_path)
    assert done.returncode == 1
    assert "wiring: i2 is reversed; [source] correction = { i_gain = [1.0, -1.0, 1.0] }" in done.stdout
    assert ".U1\n" in done.stdout and "I lags U by" in done.stdout
    values = mains.codes * np.array(mains.scale)
    power = 3 * (values[:, 0] * values[:, 1]).mean()
    known = acqd_here("doctor", "--wiring", "--seconds", "1", "--power", power, "--json", cwd=tmp_path)
    assert [one["text"] for one in json.loads(known.stdout)["findings"]] == ["i2 is reversed"]
    rated = acqd_here("doctor", "--wiring", "--seconds", "1", "--rated", power / 4, "--json", cwd=tmp_path)
    [finding] = json.loads(rated.stdout)["findings"]
    assert "i2 is reversed, and P is" in finding["text"] and "i_gain = [0.2, -0.2, 0.2]" in finding["correction"]
    quiet = replace(waveform, codes=mains.codes[:, :2], form=StreamFormat(20_000.0, tuple(mains.scale[:2])))
    monkeypatch.setattr("acqd.daemon.wiring_check.captured", lambda *_: npz_bytes(quiet))
    single = acqd_here("doctor", "--wiring", "--seconds", "1", cwd=tmp_path)
    assert single.returncode == 0 and "nothing is wrong that phasors show" in single.stdout


@pytest.mark.parametrize(
    ("load", "said"),
    [((), "no reading shows it"), (("--power", "318"), "5 times too large"), (("--rated", "400"), "5 times too large"),
     (("--power", "1590"), "nothing is wrong that the power shows")],
)  # fmt: skip
def test_doctor_reads_a_meter_and_judges_its_ratio_by_the_load(load, said, tmp_path, monkeypatch):
    (tmp_path / "acqd.toml").write_text(
        '[source]\nkind = "meters"\nhost = "127.0.0.1"\nmeters = [{ name = "m1", profile = "sdm630" }]\n'
    )

    class Rows(Heard):
        def __init__(self, _address, device, topics, fields):
            super().__init__(None, device, topics, fields)
            for topic in topics:
                self.take(topic, b'{"Vrms": 230.0, "Irms": 2.5, "P": 530.0, "PF": null}')
                self.take(topic, b"[]")

    monkeypatch.setattr("acqd.daemon.meter_ratio.Heard", Rows)
    monkeypatch.setattr("acqd.daemon.meter_ratio.time", SimpleNamespace(sleep=lambda _: None))
    done = acqd_here("doctor", "--wiring", "--seconds", "1", *load, cwd=tmp_path)
    assert said in done.stdout and "L2: Vrms 230, Irms 2.5, P 530" in done.stdout
    assert done.returncode == ("too large" in said)
    other = acqd_here("doctor", "--wiring", "--device", "m2", "--seconds", "1", cwd=tmp_path)
    assert other.returncode == 2 and "m1" in other.stderr


def test_a_broker_that_is_away_is_said_once_and_fails_where_it_was_asked_for(tmp_path):
    users = "".join(f"{name} = {{ username = '{name}', password = 'p' }}\n" for name in ("sink", "web", "operator"))
    (tmp_path / "acqd.toml").write_text(f"[mqtt]\nport = {free_port()}\nusername = 'box'\npassword = 'p'\n{users}")
    checked = acqd_here("config", "check", "--connect", "--config", tmp_path / "acqd.toml", "--json", cwd=tmp_path)
    doctor = acqd_here("doctor", "--config", tmp_path / "acqd.toml", "--json", cwd=tmp_path)
    for done, state in ((checked, "fail"), (doctor, "warn")):
        [found] = [one for one in json.loads(done.stdout) if one["check"] == "broker"]
        assert found["state"] == state and "does not answer (Connection refused)" in found["finding"]
    assert checked.returncode == 1
