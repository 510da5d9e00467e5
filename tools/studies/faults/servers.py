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
ROLE, _ADMINISTRATOR = "acqd", "administrator"
"""Who owns the database of the sink, and who may take that away."""
_QUIET: dict[str, Any] = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}


def broker(kind: str, folder: Path, port: int, environment: dict[str, str] | None = None) -> Process:
    """mosquitto as config/mosquitto.conf configures it, with or without persistence, or the embedded broker."""
    log = folder / "broker.log"
    if kind == "embedded":
        command = limited([*ACQD, "broker", "--port", str(port)], unit_limit("acqd-broker"))
        return Process(command, log, lambda: listens(port), {"env": environment})
    config, store = folder / "mosquitto.conf", folder / "broker"
    store.mkdir()
    text = (Path(__file__).parents[3] / "config" / "mosquitto.conf").read_text()
    text = text.replace("listener 1883", f"listener {port}")
    keep = kind == "mosquitto"
    text = text.replace("persistence true", f"persistence {'true' if keep else 'false'}")
    config.write_text(f"{text}\npersistence_location {store}/\nuser root\n")
    program = shutil.which("mosquitto", path=f"{os.environ['PATH']}:/usr/sbin") or "mosquitto"
    return Process([program, "-c", str(config)], log, lambda: listens(port))


def postgres(folder: Path, place: Path, log: Path | None = None) -> tuple[Process, str]:
    """A private server with its default durability, and its URL.

    Its files are in `place`, its write-ahead log in `log` if that is given, what it says in `folder`.
    """
    programs = sorted(Path("/usr/lib/postgresql").glob("*/bin"), key=lambda path: float(path.parent.name))[-1]
    port = free_port()
    user: dict[str, Any] = {}
    if os.geteuid() == 0:  # PostgreSQL refuses to run as root
        for own in (place, *([log] if log else [])):
            shutil.chown(own, "postgres")
        for parent in (folder, *folder.parents[:3]):
            with suppress(PermissionError):
                parent.chmod(parent.stat().st_mode | 0o055)
        user = {"user": "postgres", "cwd": "/"}
    data = place / "data"
    separate = ["-X", str(log / "wal")] if log else []
    make = [str(programs / "initdb"), "-D", str(data), "-A", "trust", "-U", _ADMINISTRATOR, *separate]
    subprocess.run(make, check=True, **_QUIET, **user)
    roles = f"CREATE ROLE {ROLE} LOGIN\nALTER DATABASE postgres OWNER TO {ROLE}\n"
    alone = [str(programs / "postgres"), "--single", "-D", str(data), "postgres"]
    subprocess.run(alone, input=roles.encode(), check=True, **_QUIET, **user)
    command = [str(programs / "postgres"), "-D", str(data), "-p", str(port), "-k", str(place)]
    ready = [str(programs / "pg_isready"), "-q", "-h", "127.0.0.1", "-p", str(port)]

    def answers() -> bool:
        time.sleep(0.05)
        return subprocess.run(ready, check=False, **_QUIET).returncode == 0

    options = ["-c", "listen_addresses=127.0.0.1", "-c", "max_wal_size=64MB", "-c", "min_wal_size=32MB"]
    if log is not None:
        options += ["-c", "wal_recycle=off"]  # else the files that are there last for minutes
    process = Process([*command, *options], folder / "postgres.log", answers, user)
    return process, f"postgresql://{ROLE}@127.0.0.1:{port}/postgres"


def administrator(url: str) -> str:
    """The same database for the one who may everything."""
    return url.replace(f"//{ROLE}@", f"//{_ADMINISTRATOR}@")


def listens(port: int) -> bool:
    """Whether somebody listens there."""
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0
