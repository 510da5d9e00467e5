"""The commands as a user types them: help and mistakes."""

from __future__ import annotations

import errno
import os
import shutil
import subprocess
import sys

import pytest

from acqd.atomic import private
from acqd.cli.main import for_people
from acqd.telemetry.broker import EmbeddedBroker, free_port
from tests.commands import ACQD, acqd, acqd_here, refused
from tests.sources.files import write_csv


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
        result = acqd_here(*command, "--help", cwd=tmp_path)
        assert result.returncode == 0 and "Example:" in result.stdout and "--json" in result.stdout, command


def test_config_mistakes_are_exit_2_and_one_line(tmp_path):
    cases = {
        "[metering]\nmod = 'fixed'\n": "did you mean metering.mode",
        "[mqtt]\npassword_file = '/nowhere'\n": "password file",
    }
    for text, complaint in cases.items():
        (tmp_path / "c.toml").write_text(text)
        assert complaint in refused(acqd_here("run", "--config", "c.toml", "--duration", "1", cwd=tmp_path)), text
    assert "no such file" in refused(acqd_here("run", "--config", "none.toml", cwd=tmp_path))


def test_mistakes_in_the_source_are_exit_2_and_one_line(tmp_path):
    cases = {
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
        assert complaint in refused(acqd_here("run", "--config", "c.toml", "--duration", "1", cwd=tmp_path)), text


@pytest.mark.skipif(os.geteuid() != 0 or shutil.which("setpriv") is None, reason="drops the rights of root by setpriv")
@pytest.mark.parametrize("kind", ["ethercat", "sampled-values"])
def test_a_user_without_the_right_is_told_which_one(kind, tmp_path):
    (tmp_path / "c.toml").write_text(f"[mqtt]\nenabled = false\n[source]\nkind = '{kind}'\ninterface = 'lo'\n")
    command = ["setpriv", "--inh-caps=-all", "--bounding-set=-all", *ACQD, "run", "--config", "c.toml"]
    result = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert "CAP_NET_RAW" in refused(result)


def test_environment_mistakes_are_named(tmp_path):
    import asyncio

    (tmp_path / "blocked").write_text("a file where a folder should be")
    refused(acqd_here("replay", "x.npz", "--out", "r.jsonl", cwd=tmp_path))
    write_csv(tmp_path / "a.csv")
    assert "cannot be written" in refused(acqd_here("replay", "a.csv", "--out", "blocked/r.jsonl", cwd=tmp_path))
    assert "does not exist" in refused(acqd_here("sink", "--database", "no/where/x.sqlite", cwd=tmp_path))
    assert "--start" in refused(acqd_here("replay", "a.csv", "--start", "noon", cwd=tmp_path))
    port = free_port()
    assert "does not answer" in refused(acqd_here("replay", "a.csv", "--publish", "--port", port, cwd=tmp_path))
    assert "is it running" in refused(acqd_here("watch", "--port", port, cwd=tmp_path))

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


def test_a_wrong_password_is_exit_2_for_viewers_and_no_end_for_services(tmp_path, mosquitto):
    mosquitto.stop()
    passwords = mosquitto.folder / "passwords"
    passwords.touch(mode=0o600)
    subprocess.run(["mosquitto_passwd", "-b", passwords, "acqd", "right"], check=True)
    mosquitto.extra = f"allow_anonymous false\npassword_file {passwords}\n"
    mosquitto.start()
    config = tmp_path / "c.toml"
    config.write_text(f"[mqtt]\nport = {mosquitto.port}\nusername = 'acqd'\npassword = 'wrong'\n")
    write_csv(tmp_path / "a.csv")
    for words in (["watch"], ["replay", "a.csv", "--publish"]):
        result = acqd_here(*words, "--config", config, cwd=tmp_path)
        assert "password" in refused_last(result), words
    for service in ("run", "sink"):  # metering goes on, and the password may be corrected at the broker
        result = acqd(service, "--config", config, "--duration", "2", cwd=tmp_path)
        assert result.returncode == 0 and "check username, password" in result.stderr, result.stderr


def refused_last(result):
    """Like `refused`, after log lines."""
    assert result.returncode == 2, result.stderr
    return result.stderr.strip().splitlines()[-1]


def test_the_daemon_starts_without_importing_sql():
    """A daemon that is started again after a crash has rows to make: SQLAlchemy takes longer than all the rest."""
    program = (
        "import sys, acqd.cli.run, acqd.daemon.service; print('sqlalchemy' in sys.modules or 'alembic' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"


def test_an_error_of_the_system_says_where_it_was_met(tmp_path, monkeypatch, capsys):
    """A bare "Invalid argument" helps nobody: the line names the file, else the step."""

    def lost(*_: object) -> None:
        raise OSError(errno.EINVAL, os.strerror(errno.EINVAL))

    for work, code, words in (
        (
            lambda: (tmp_path / "none").read_bytes(),
            2,
            [f"{tmp_path / 'none'}: no such file or folder; check the path"],
        ),
        (lambda: private("x", 0), 1, ["Invalid argument", "in private (acqd/atomic.py, line "]),
        (lost, 1, ["Invalid argument", "in for_people"]),
    ):
        with monkeypatch.context() as patch, pytest.raises(SystemExit) as end:
            patch.setattr(os, "open", lost)
            for_people(work)
        said = capsys.readouterr().err
        assert end.value.code == code and said.count("\n") == 1 and all(word in said for word in words), said


FULL = """
import sys
from pathlib import Path
from acqd.atomic import naming
from acqd.cli.main import for_people

def bill(config=Path("config.toml"), state=Path("state.json")):
    print("12 kWh")

def write(config=Path("config.toml"), out=Path("/dev/full")):
    with naming(out):
        out.write_bytes(b"x" * 20_000)

for_people({"bill": bill, "write": write}[sys.argv[1]])
"""


@pytest.mark.parametrize(
    ("step", "out", "words"),
    [("bill", "/dev/full", "standard output: No space left"), ("write", "/dev/null", "/dev/full: No space left")],
)
def test_a_full_disk_is_named_by_the_file_that_was_written(step, out, words):
    with open(out, "w") as file:
        done = subprocess.run([sys.executable, "-c", FULL, step], stdout=file, stderr=subprocess.PIPE, text=True,
                              env=os.environ | {"PYTHONUNBUFFERED": ""}, check=False)  # fmt: skip
    assert done.returncode == 2 and done.stderr.count("\n") == 1 and words in done.stderr, done.stderr
