"""Broker and database of a bed."""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

from acqd.telemetry.ports import free_port
from tools.studies.faults.memory import limited, unit_limit
from tools.studies.faults.process import Process

ACQD = [sys.executable, "-m", "acqd"]
_QUIET: dict[str, Any] = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}


def broker(kind: str, folder: Path, port: int, environment: dict[str, str] | None = None) -> Process:
    """mosquitto as config/mosquitto.conf configures it, with or without persistence, or the embedded broker."""
    log = folder / "broker.log"
    if kind == "embedded":
        command = limited([*ACQD, "broker", "--port", str(port)], unit_limit("acqd-broker"))
        return Process(command, log, lambda: _listens(port), {"env": environment})
    config, store = folder / "mosquitto.conf", folder / "broker"
    store.mkdir()
    text = (Path(__file__).parents[3] / "config" / "mosquitto.conf").read_text()
    text = text.replace("listener 1883", f"listener {port}")
    keep = kind == "mosquitto"
    text = text.replace("persistence true", f"persistence {'true' if keep else 'false'}")
    config.write_text(f"{text}\npersistence_location {store}/\nuser root\n")
    program = shutil.which("mosquitto", path=f"{os.environ['PATH']}:/usr/sbin") or "mosquitto"
    return Process([program, "-c", str(config)], log, lambda: _listens(port))


def postgres(folder: Path, place: Path) -> tuple[Process, str]:
    """A private server with its default durability; its files are in `place`, its log in `folder`. And its URL."""
    programs = sorted(Path("/usr/lib/postgresql").glob("*/bin"), key=lambda path: float(path.parent.name))[-1]
    port = free_port()
    user: dict[str, Any] = {}
    if os.geteuid() == 0:  # PostgreSQL refuses to run as root
        shutil.chown(place, "postgres")
        for parent in (folder, *folder.parents[:3]):
            with suppress(PermissionError):
                parent.chmod(parent.stat().st_mode | 0o055)
        user = {"user": "postgres", "cwd": "/"}
    data = place / "data"
    subprocess.run(
        [str(programs / "initdb"), "-D", str(data), "-A", "trust", "-U", "acqd"], check=True, **_QUIET, **user
    )
    command = [str(programs / "postgres"), "-D", str(data), "-p", str(port), "-k", str(place)]
    ready = [str(programs / "pg_isready"), "-q", "-h", "127.0.0.1", "-p", str(port)]

    def answers() -> bool:
        time.sleep(0.05)
        return subprocess.run(ready, check=False, **_QUIET).returncode == 0

    options = ["-c", "listen_addresses=127.0.0.1", "-c", "max_wal_size=64MB"]
    process = Process([*command, *options], folder / "postgres.log", answers, user)
    return process, f"postgresql://acqd@127.0.0.1:{port}/postgres"


def _listens(port: int) -> bool:
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0
