"""The processes under test: daemon, sink and sidecar, each behind a proxy to the broker, and a database."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import orjson
import sqlalchemy as sa

from acqd.daemon.health.section import HealthSection
from acqd.storage.database import engine_for, open_database
from acqd.storage.last_rows import Asked, last_rows
from acqd.telemetry.ports import free_port
from tools.studies.faults import disk
from tools.studies.faults.clock import FakedClock
from tools.studies.faults.logs import LOG_DEVICE, RobotLogs
from tools.studies.faults.memory import limited, unit_limit
from tools.studies.faults.process import Process
from tools.studies.faults.proxy import Proxy
from tools.studies.faults.refusals import Refusals
from tools.studies.faults.servers import ACQD, administrator, broker, postgres

BROKERS = ("mosquitto", "mosquitto-memory", "embedded")
"""With and without persistence, and amqtt."""
DATABASES = ("sqlite", "postgres")
DEVICE = "cell1"
_STATE_MB, _DATABASE_MB, _LOG_MB = 96, 512, 256
_FOLDERS = {"daemon": "state", "sink": "database"}
"""Where a service keeps its files."""


@dataclass(frozen=True, slots=True)
class Kind:
    """What a bed is made of."""

    broker: str
    database: str

    def __str__(self) -> str:
        return f"{self.broker}+{self.database}"


@dataclass(frozen=True, slots=True)
class Extras:
    """What some studies need besides broker, database, sink and daemon."""

    clock: bool = False
    """Daemon and sink run under libfaketime, so that their clocks can be set."""
    disks: bool = False
    """Spool and database have small disks, so that they can be filled."""
    refusals: bool = False
    """The disks of daemon and sink answer errors when they are told to."""
    pooler: bool = False
    """PgBouncer is there."""
    sidecar: bool = False
    """A sidecar works on robot logs."""
    daemon_memory: int | None = None
    """Memory limit of the daemon [bytes] instead of its unit's limit."""


class Bed:
    """Starts everything in a folder, and stops it. Processes have the memory limits of their units."""

    def __init__(self, kind: Kind, folder: Path, extras: Extras | None = None) -> None:
        """Raises OperationError."""
        self.kind, self.folder, extras = kind, folder, extras or Extras()
        folder.mkdir(parents=True)
        self.tape, self.strangers, self.forged = (folder / f"{name}.jsonl" for name in ("tape", "strangers", "forged"))
        """Rows of the daemon; rows of others, to be stored, too; rows that pretend to be the daemon's."""
        for file in (self.tape, self.strangers, self.forged):
            file.touch()
        self.disks = _disks(folder, kind) if extras.disks else {}
        self.port = free_port()
        self.health = HealthSection(port=free_port(), sink_port=free_port())
        self.proxies = {name: Proxy(self.port) for name in ("daemon", "sink", "sidecar")}
        self.database, self.url = self._storage()
        self.environment = _installed(folder.parent / "bytecode")
        self.broker = broker(kind.broker, folder, self.port, self.environment)
        self.daemon = self._service("daemon", extras.daemon_memory or unit_limit("acqd"), "run", "--tape", self.tape)
        self.sink = self._service("sink", unit_limit("acqd-sink"), "sink")
        self.clock, self.sink_clock = (
            self._clock(process, name) if extras.clock else None
            for process, name in ((self.daemon, "daemon"), (self.sink, "sink"))
        )
        self.refusals = (
            {name: self._refusals(process, name) for name, process in (("daemon", self.daemon), ("sink", self.sink))}
            if extras.refusals
            else {}
        )
        self.logs = RobotLogs(folder / "logs", folder / "model") if extras.sidecar else None
        self.sidecar: Process | None = None
        if self.logs is not None:
            model = ("--model", self.logs.model, "--device", LOG_DEVICE)
            self.sidecar = self._service(
                "sidecar", unit_limit("acqd-sidecar"), "sidecar", self.logs.folder, *model, "--json"
            )
        self._engine: sa.Engine | None = None

    @property
    def tapes(self) -> tuple[Path, Path]:
        """All rows that have to be stored."""
        return self.tape, self.strangers

    @property
    def state_dir(self) -> Path:
        """Files of the daemon."""
        return self.folder / "state"

    @property
    def engine(self) -> sa.Engine:
        """The database, to look into."""
        if self._engine is None:
            open_database(self.url).dispose()  # the tables belong to the sink's role
            self._engine = engine_for(administrator(self.url))
        return self._engine

    def start(self) -> None:
        """Database, broker, sink, daemon, sidecar."""
        if self.database is not None:
            self.database.start()
        if self.logs is not None:
            self.logs.prepare(self.engine)
        for process in (self.broker, self.sink, self.daemon, self.sidecar):
            if process is not None:
                process.start()

    def services(self) -> Iterator[tuple[str, Process]]:
        """The processes that run, in the order of their start."""
        for name in ("database", "broker", "sink", "daemon", "sidecar"):
            process: Process | None = getattr(self, name)
            if process is not None and process.running is not None:
                yield name, process

    def revive(self) -> None:
        """Start what has died."""
        for _, process in self.services():
            process.revive()

    def stop(self) -> None:
        """Everything, in the order of the rows."""
        services = dict(self.services())
        for name in ("sidecar", "daemon", "sink", "broker", "database"):
            if name in services:
                services[name].stop()
        for proxy in self.proxies.values():
            proxy.close()
        if self._engine is not None:
            self._engine.dispose()
        for small in self.disks.values():
            small.unmount()

    def taped(self) -> int:
        """Length of the tape [bytes]."""
        return self.tape.stat().st_size

    def arrived(self, offset: int) -> bool:
        """Whether a row that was taped behind `offset` is stored: by its number, whatever the clocks say."""
        with self.tape.open("rb") as file:
            file.seek(offset)
            rows = [orjson.loads(line) for line in file.read().split(b"\n")[:-1] if line.startswith(b"{")]
        if not rows:
            return False
        boot = rows[-1]["boot"]
        first = min(row["seq"] for row in rows if row["boot"] == boot)
        try:
            with self.engine.connect() as connection:
                newest = last_rows(connection, Asked(DEVICE, boot.partition(".")[0]))
        except sa.exc.SQLAlchemyError:
            return False
        return any(row.channel == "total" and row.boot == boot and row.seq >= first for row in newest)

    def _storage(self) -> tuple[Process | None, str]:
        place = self.folder / "database"
        place.mkdir(exist_ok=True)
        if self.kind.database == "postgres":
            return postgres(self.folder, place, self.folder / "log" if "log" in self.disks else None)
        return None, f"{place / 'rows.sqlite'}"

    def _clock(self, process: Process, name: str) -> FakedClock:
        faked = FakedClock(self.folder / f"{name}.clock")
        process.options["env"] = self.environment | faked.environment()
        return faked

    def _refusals(self, process: Process, name: str) -> Refusals:
        refusals = Refusals(self.folder / f"{name}.refusals", self.folder / _FOLDERS[name])
        environment = process.options["env"]
        process.options["env"] = environment | refusals.environment(environment.get("LD_PRELOAD", ""))
        return refusals

    def _service(self, name: str, memory: int, *command: object) -> Process:
        config, state = self.folder / f"{name}.toml", self.state_dir
        state.mkdir(exist_ok=True)
        config.write_text(
            f'device = "{DEVICE}"\nstate_dir = "{state}"\n[realtime]\npriority = 0\n'
            f'[mqtt]\nport = {self.proxies[name].port}\n[sink]\ndatabase = "{self.url}"\nclient_id = "faults"\n'
            "keep_days = 30\n"
            f"[health]\nport = {self.health.port}\nsink_port = {self.health.sink_port}\n"
        )
        arguments = [*ACQD, *map(str, command), "--config", str(config)]
        options = {"cwd": self.folder, "env": self.environment}
        return Process(limited(arguments, memory), self.folder / f"{name}.log", options=options)


def _installed(bytecode: Path) -> dict[str, str]:
    """Environment of services that start as installed ones do: from bytecode, which pip makes, not from sources."""
    environment = dict(os.environ) | {"PYTHONPYCACHEPREFIX": str(bytecode)}
    environment.pop("PYTHONDONTWRITEBYTECODE", None)
    return environment


def _disks(folder: Path, kind: Kind) -> dict[str, disk.SmallDisk]:
    disk.own_mounts()
    disks = {
        "spool": disk.SmallDisk(folder / "state", _STATE_MB),
        "database": disk.SmallDisk(folder / "database", _DATABASE_MB),
    }
    if kind.database == "postgres":
        disks["log"] = disk.SmallDisk(folder / "log", _LOG_MB)
    return disks
