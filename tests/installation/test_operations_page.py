"""Every command of docs/operations.md, typed by hand after `acqd service install`, beside the running services."""

from __future__ import annotations

import re
import shlex
import sqlite3
import subprocess
from pathlib import Path

import pytest

from acqd.daemon import config_place
from acqd.telemetry.broker import free_port
from tests.commands import ACQD, acqd_here
from tests.installation.roots import NEEDS, bare, installed
from tests.places import ROOT
from tests.waiting import wait_for

pytestmark = NEEDS

PAGE = (ROOT / "docs/operations.md").read_text()
NOT_BY_HAND = {
    "run": "the daemon is this test's fixture",
    "web": "serves until it is stopped: tests/web",
    "modbus": "needs a meter: tests/sources",
}
SHORT = {"watch": ["--duration", "0.3"], "jitter": ["--duration", "0.5"], "capture": ["--seconds", "0.5"]}
"""Options that end a command soon."""


def commands():
    """Every command of the page once, as a list of words without `acqd`."""
    typed = re.findall(r"`acqd ([^`]+)`", PAGE)
    typed += re.findall(r"(?m)^(?:sudo )?acqd (.+?)(?: {2,}#.*)?$", "\n".join(re.findall(r"(?s)```sh\n(.*?)```", PAGE)))
    once = {re.sub(r" --config \S+", "", one): one for one in typed}  # with and without --config: one of them
    return [shlex.split(one) for one in once.values()]


@pytest.fixture
def services(root, mosquitto, monkeypatch):
    """Daemon and sink as their units start them, at a broker with passwords; rows are in the database."""
    installed(root, "--device", "hall-3")
    mosquitto.stop()
    access = (root / "etc/mosquitto/conf.d/acqd.conf").read_text()
    lines = [line for line in access.splitlines() if line.startswith(("password_file", "acl_file", "allow"))]
    mosquitto.extra = "\n".join(line.replace(" /etc", f" {root}/etc") for line in lines) + "\n"
    mosquitto.start()
    config = root / "etc/acqd/acqd.toml"
    text = config.read_text()
    for port, used in (("1883", mosquitto.port), ("9731", free_port()), ("9732", free_port())):
        text = text.replace(f"port = {port}", f"port = {used}")
    config.write_text(text)
    monkeypatch.setattr(config_place, "PLACES", (Path("acqd.toml"), config))
    running = [subprocess.Popen([*ACQD, *name, "--config", config], cwd=root) for name in (["run"], ["sink"])]
    database = root / "var/lib/acqd/acqd.sqlite"

    def stored():
        if not database.exists():
            return False
        with sqlite3.connect(database) as connection:
            there = connection.execute("SELECT 1 FROM sqlite_master WHERE name = 'power'").fetchone()
            return there and connection.execute("SELECT count(*) FROM power").fetchone()[0]

    wait_for(stored, "rows are in the database")
    yield root
    for process in running:
        process.terminate()
    for process in running:
        process.wait(60)


def test_the_page_names_commands():
    assert len(commands()) > 15 and {"status", "doctor", "sink", "service", "config"} <= {one[0] for one in commands()}


def test_every_command_of_the_page_works_by_hand(services, tmp_path, tmp_path_factory):
    root, folder = services, tmp_path_factory.mktemp("by-hand")
    other = bare(tmp_path_factory.mktemp("other"))
    for words in commands():
        if words[0] in NOT_BY_HAND:
            continue
        installed_file = f"{root}/etc/acqd/acqd.toml"
        replaced = {"/etc/acqd/acqd.toml": installed_file, "FILE": installed_file, "DAY": "today"}
        words = [replaced.get(word, word.replace("/mnt/backup", str(folder))) for word in words]
        if words[0] == "service":
            words += ["--root", str(other if "restore" in words else root)]
            words += ["--program", "/bin/true"] if words[1] in ("update", "restore") else []
        done = acqd_here(*words, *SHORT.get(words[0], []), cwd=folder)
        said = f"acqd {' '.join(words)}: exit {done.returncode}\n{done.stdout}\n{done.stderr}"
        allowed = {"doctor": (0, 1), "status": (0, 1), "archive": (0, 2)}.get(words[0], (0,))  # no samples are kept
        if "completeness" in words:
            allowed = (0, 1)  # the services are there since today
        assert done.returncode in allowed, said
        assert "no credentials" not in said and "no state_dir" not in said, said
        assert "no such file" not in done.stderr or words[:2] == ["archive", "list"], said
    status = acqd_here("status", cwd=folder)
    assert status.returncode == 0, status.stdout
    checked = acqd_here("config", "check", "--connect", cwd=folder)
    assert "as acqd-sink" in checked.stdout and "as viewer" in checked.stdout
