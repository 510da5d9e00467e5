"""The processes under test: daemon and sink, each behind a proxy to the broker, and a database."""

from __future__ import annotations

import os
import shutil
import socket
import subprocess
import sys
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import orjson
import sqlalchemy as sa

from acqd.errors import UserError
from acqd.storage.database import open_database
from acqd.storage.schema import power
from acqd.telemetry.broker import free_port
from tools.studies.faults.memory import limited, unit_limit
from tools.studies.faults.process import Process
from tools.studies.faults.proxy import Proxy

BROKERS = ("mosquitto", "mosquitto-memory", "embedded")
"""With and without persistence, and amqtt."""
DATABASES = ("sqlite", "postgres")
DEVICE = "cell1"
CLOCK_CACHE_S = 1
"""How long libfaketime may take to notice that the clock was set [s]."""
_ACQD = [sys.executable, "-m", "acqd"]


@dataclass(frozen=True, slots=True)
class Kind:
    """What a bed is made of."""

    broker: str
    database: str

    def __str__(self) -> str:
        return f"{self.broker}+{self.database}"


class Bed:
    """Starts everything in a folder, and stops it."""

    def __init__(self, kind: Kind, folder: Path, faked_clock: bool = False, daemon_memory: int | None = None) -> None:
        """`faked_clock`: the daemon runs under libfaketime, so that its clock can be set. Raises UserError without.

        `daemon_memory`: limit [bytes] instead of that of the unit.
        """
        self.kind, self.folder = kind, folder
        self._memory = {"daemon": daemon_memory or unit_limit("acqd"), "sink": unit_limit("acqd-sink")}
        folder.mkdir(parents=True)
        self._offset = folder / "clock"
        self.set_clock(0.0)
        self.tape = folder / "tape.jsonl"
        self.port = port = free_port()
        self.proxies = {"daemon": Proxy(port), "sink": Proxy(port)}
        self.database: Process | None = None
        self.url = f"{folder / 'rows.sqlite'}"
        if kind.database == "postgres":
            self.database, self.url = _postgres(folder)
        self.broker = _broker(kind.broker, folder, port)
        self.daemon = self._service("daemon", "run", "--tape", str(self.tape))
        self.sink = self._service("sink", "sink")
        if faked_clock:
            self.daemon.options["env"] = os.environ | _faketime(self._offset)
        self._engine: sa.Engine | None = None

    @property
    def engine(self) -> sa.Engine:
        """The database, to look into."""
        if self._engine is None:
            self._engine = open_database(self.url)
        return self._engine

    def start(self) -> None:
        """Database, broker, sink, daemon."""
        for process in (self.database, self.broker, self.sink, self.daemon):
            if process is not None:
                process.start()

    def revive(self) -> None:
        """Start what has died."""
        for process in (self.database, self.broker, self.sink, self.daemon):
            if process is not None:
                process.revive()

    def stop(self) -> None:
        """Everything, in the order of the rows."""
        for process in (self.daemon, self.sink, self.broker, self.database):
            if process is not None and process.running is not None:
                process.stop()
        for proxy in self.proxies.values():
            proxy.close()
        if self._engine is not None:
            self._engine.dispose()

    def set_clock(self, seconds: float) -> None:
        """Put the daemon's clock so many seconds ahead of this computer's."""
        new = self._offset.with_suffix(".new")
        new.write_text(f"{seconds:+}")
        os.replace(new, self._offset)

    def taped(self) -> int:
        """Length of the tape [bytes]."""
        return self.tape.stat().st_size if self.tape.exists() else 0

    def arrived(self, offset: int) -> bool:
        """Whether a row that was taped behind `offset` is stored: by its number, whatever the clocks say."""
        with self.tape.open("rb") as file:
            file.seek(offset)
            rows = [orjson.loads(line) for line in file.read().split(b"\n")[:-1] if line.startswith(b"{")]
        if not rows:
            return False
        boot = rows[-1]["boot"]
        first = min(row["seq"] for row in rows if row["boot"] == boot)
        c = power.c
        query = sa.select(sa.func.max(c.seq)).where(c.device == DEVICE, c.channel == "total", c.boot == boot)
        try:
            with self.engine.connect() as connection:
                newest = connection.execute(query).scalar()
        except sa.exc.SQLAlchemyError:
            return False
        return newest is not None and newest >= first

    def _service(self, name: str, *command: str) -> Process:
        config = self.folder / f"{name}.toml"
        (self.folder / "state").mkdir(exist_ok=True)
        config.write_text(
            f'device = "{DEVICE}"\nstate_dir = "{self.folder / "state"}"\n[realtime]\npriority = 0\n'
            f'[mqtt]\nport = {self.proxies[name].port}\n[sink]\ndatabase = "{self.url}"\nclient_id = "faults"\n'
            f"[health]\nport = {free_port()}\nsink_port = {free_port()}\n"
        )
        arguments = [*_ACQD, *command, "--config", str(config)]
        return Process(
            limited(arguments, self._memory[name]), self.folder / f"{name}.log", options={"cwd": self.folder}
        )


def _faketime(offset: Path) -> dict[str, str]:
    found = sorted(Path("/usr/lib").glob("*/faketime/libfaketime.so.1"))
    if not found:
        raise UserError("--clock needs libfaketime: apt-get install libfaketime")
    return {
        "LD_PRELOAD": str(found[-1]), "FAKETIME_TIMESTAMP_FILE": str(offset), "FAKETIME_DONT_FAKE_MONOTONIC": "1",
        "DONT_FAKE_MONOTONIC": "1", "FAKETIME_CACHE_DURATION": str(CLOCK_CACHE_S),
    }  # fmt: skip


def _listens(port: int) -> bool:
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


def _broker(kind: str, folder: Path, port: int) -> Process:
    log = folder / "broker.log"
    if kind == "embedded":
        command = limited([*_ACQD, "broker", "--port", str(port)], unit_limit("acqd-broker"))
        return Process(command, log, lambda: _listens(port))
    config, store = folder / "mosquitto.conf", folder / "broker"
    store.mkdir()
    text = (Path(__file__).parents[3] / "config" / "mosquitto.conf").read_text()
    text = text.replace("listener 1883", f"listener {port}")
    keep = kind == "mosquitto"
    text = text.replace("persistence true", f"persistence {'true' if keep else 'false'}")
    config.write_text(f"{text}\npersistence_location {store}/\nuser root\n")
    program = shutil.which("mosquitto", path=f"{os.environ['PATH']}:/usr/sbin") or "mosquitto"
    return Process([program, "-c", str(config)], log, lambda: _listens(port))


def _postgres(folder: Path) -> tuple[Process, str]:
    """A private server with its default durability."""
    programs = sorted(Path("/usr/lib/postgresql").glob("*/bin"), key=lambda path: float(path.parent.name))[-1]
    port, place = free_port(), folder / "postgres"
    place.mkdir()
    user: dict[str, Any] = {}
    if os.geteuid() == 0:  # PostgreSQL refuses to run as root
        shutil.chown(place, "postgres")
        for parent in (folder, *folder.parents[:3]):
            with suppress(PermissionError):
                parent.chmod(parent.stat().st_mode | 0o055)
        user = {"user": "postgres", "cwd": "/"}
    data = place / "data"
    quiet: dict[str, Any] = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
    subprocess.run(
        [str(programs / "initdb"), "-D", str(data), "-A", "trust", "-U", "acqd"], check=True, **quiet, **user
    )
    command = [str(programs / "postgres"), "-D", str(data), "-p", str(port), "-k", str(place)]
    ready = [str(programs / "pg_isready"), "-q", "-h", "127.0.0.1", "-p", str(port)]

    def answers() -> bool:
        time.sleep(0.05)
        return subprocess.run(ready, check=False, **quiet).returncode == 0

    process = Process([*command, "-c", "listen_addresses=127.0.0.1"], folder / "postgres.log", answers, user)
    return process, f"postgresql://acqd@127.0.0.1:{port}/postgres"
