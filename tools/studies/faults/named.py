"""How long until `acqd status` names a fault: every fault is there until its cause is named, at most 20 s."""

from __future__ import annotations

import errno
import os
import re
import shutil
import signal
import subprocess
import time
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from pathlib import Path

import orjson
import paho.mqtt.client as paho
import sqlalchemy as sa
from paho.mqtt.enums import CallbackAPIVersion

from acqd.daemon.health.query import Service, ask
from tools.studies.faults.bed import DEVICE, Bed, Extras, Kind
from tools.studies.faults.fault import Begin
from tools.studies.faults.on_hosts import (
    SMALL_MESSAGES,
    SMALL_PACKETS,
    broker_set_to,
    database_renamed,
    password_wanted,
    read_only,
    schema_renamed,
)
from tools.studies.faults.on_postgres import DISCONNECT, as_administrator, use_up_log
from tools.studies.faults.process import Process
from tools.studies.faults.servers import ACQD, ROLE

WITHIN_S = 10.0
_PATIENCE_S = 20.0
_READY_S = 30.0
_IDLE = 500


@dataclass(frozen=True, slots=True)
class Case:
    """A fault, and the sentence that has to name it."""

    fault: str
    begin: Begin
    service: Service
    words: str
    """Regular expression."""
    until: str = "stored"
    database: str = "sqlite"
    need: str = ""
    """Of the bed: clock, disks or refusals."""
    tls: bool = False
    """The broker is reached by TLS."""


@dataclass(frozen=True, slots=True)
class Named:
    """One measurement."""

    fault: str
    seconds: float | None
    """From the moment in which the fault is there until the status names it; None: not within 20 s."""
    sentence: str

    @property
    def good(self) -> bool:
        """Whether the status has named the fault in time."""
        return self.seconds is not None and self.seconds <= WITHIN_S


def measure(case: Case, folder: Path) -> Named:
    """Start a bed, let rows arrive, begin the fault, and ask until the status names it."""
    extras = Extras(clock=case.need == "clock", disks=case.need == "disks", refusals=case.need == "refusals")
    bed = Bed(Kind("mosquitto", case.database), folder, extras)
    _configure(bed, case.until)
    if case.tls:
        _encrypt(bed)
    with ExitStack() as stack:
        stack.callback(bed.stop)
        bed.start()
        _wait_until_ready(bed)
        with ExitStack() as fault:
            before = _sentence(bed, case)
            case.begin(bed, fault)
            begun = time.monotonic()
            sentence = ""
            while not (sentence := _sentence(bed, case)) and time.monotonic() - begun < _PATIENCE_S:
                time.sleep(0.1)
            seconds = round(time.monotonic() - begun, 1)
    return Named(case.fault, seconds if sentence and not before else None, sentence)


def _configure(bed: Bed, until: str) -> None:
    path = bed.folder / "daemon.toml"
    path.write_text(f'{path.read_text()}[spool]\nuntil = "{until}"\n')
    rules = bed.folder / "acl"
    rules.write_text("topic readwrite #\n")
    rules.chmod(0o644)
    with (bed.folder / "mosquitto.conf").open("a") as file:
        file.write(f"acl_file {rules}\n")


def _encrypt(bed: Bed) -> None:
    """Certificates for the broker, and a CA for daemon and sink."""
    folder = _certificates(bed, "certificates")
    path = bed.folder / "mosquitto.conf"
    files = f"cafile {folder}/ca.pem\ncertfile {folder}/broker.pem\nkeyfile {folder}/broker.key\n"
    path.write_text(re.sub(r"^(listener .*\n)", lambda found: found[1] + files, path.read_text(), flags=re.MULTILINE))
    for name in ("daemon", "sink"):
        config = bed.folder / f"{name}.toml"
        config.write_text(config.read_text().replace("[mqtt]\n", f'[mqtt]\nca_file = "{folder}/ca.pem"\n'))


def _certificates(bed: Bed, name: str) -> Path:
    script = Path(__file__).parents[3] / "config" / "make-certificates.sh"
    subprocess.run(["sh", str(script), str(bed.folder / name), "127.0.0.1"], check=True, capture_output=True)
    return bed.folder / name


def _other_ca(bed: Bed, _fault: ExitStack) -> None:
    """The broker gets a certificate of another CA, which has the same name."""
    new = _certificates(bed, "new")
    for name in ("broker.pem", "broker.key"):
        shutil.copy(new / name, bed.folder / "certificates" / name)
    bed.broker.stop()
    bed.broker.start()


def _wait_until_ready(bed: Bed) -> None:
    deadline = time.monotonic() + _READY_S
    while time.monotonic() < deadline:
        answers = [ask(bed.health, "daemon"), ask(bed.health, "sink")]
        if all(answer is not None and answer.ready for answer in answers) and bed.arrived(0):
            return
        time.sleep(0.2)


def _sentence(bed: Bed, case: Case) -> str:
    answer = ask(bed.health, case.service)
    problems = answer.problems if answer is not None else []
    return next((text for text in problems if re.search(case.words, text)), "")


def _refused_rows(bed: Bed, _fault: ExitStack) -> None:
    (bed.folder / "acl").write_text(
        f"topic readwrite acqd/{DEVICE}/status\ntopic readwrite acqd/{DEVICE}/ask\ntopic readwrite acqd/sink/+/status\n"
        f"topic readwrite acqd/{DEVICE}/receipt\n"
    )
    bed.broker.send(signal.SIGHUP)


def _renamed(bed: Bed, _fault: ExitStack) -> None:
    bed.proxies["daemon"].mode = "refuse"
    bed.proxies["daemon"].reset()
    time.sleep(1.5)
    bed.daemon.stop()
    path = bed.folder / "daemon.toml"
    path.write_text(path.read_text().replace(f'device = "{DEVICE}"', 'device = "cell2"'))
    bed.daemon.start()


def _empty_server(bed: Bed, _fault: ExitStack) -> None:
    with bed.engine.begin() as connection:
        for kind, name in connection.execute(
            sa.text(
                "SELECT CASE relkind WHEN 'v' THEN 'VIEW' ELSE 'TABLE' END, relname FROM pg_class "
                "WHERE relkind IN ('r', 'v', 'p') AND relnamespace = 'public'::regnamespace ORDER BY relkind DESC"
            )
        ).all():
            connection.exec_driver_sql(f'DROP {kind} IF EXISTS "{name}" CASCADE')


def _two_daemons(bed: Bed, fault: ExitStack) -> None:
    folder = bed.folder / "second"
    folder.mkdir()
    config = folder / "acqd.toml"
    config.write_text(
        f'device = "{DEVICE}"\nstate_dir = "{folder}"\n[realtime]\npriority = 0\n[mqtt]\nport = {bed.port}\n'
        "[source]\npower = 900.0\n[health]\nport = 0\n"
    )
    second = Process([*ACQD, "run", "--config", str(config)], folder / "log")
    second.start()
    fault.callback(second.kill)


def _slow_commits(bed: Bed, fault: ExitStack) -> None:
    connection = fault.enter_context(bed.engine.connect())
    connection.exec_driver_sql("BEGIN IMMEDIATE")
    fault.callback(connection.exec_driver_sql, "ROLLBACK")


def _moved(bed: Bed, fault: ExitStack) -> None:
    path = Path(str(bed.engine.url.database))
    away = path.with_name("moved")
    path.rename(away)
    fault.callback(away.rename, path)


def _replaced(bed: Bed, _fault: ExitStack) -> None:
    path = Path(str(bed.engine.url.database))
    copy = path.with_name("copy")
    shutil.copy(path, copy)
    with suppress(sa.exc.SQLAlchemyError), sa.create_engine(f"sqlite:///{copy}").begin() as connection:
        connection.exec_driver_sql("UPDATE database_state SET value = 'other' WHERE key = 'identity'")
    copy.replace(path)
    for name in ("-wal", "-shm"):
        path.with_name(path.name + name).unlink(missing_ok=True)


def _unreadable(bed: Bed, _fault: ExitStack) -> None:
    proxy = bed.proxies["daemon"]
    proxy.mode = "refuse"
    proxy.reset()
    time.sleep(1.5)
    bed.daemon.stop()
    for path in (bed.folder / "state").glob("spool-*/*.seg"):
        path.rename(path.with_suffix(".whole"))
        path.symlink_to(path.name)
    bed.daemon.start()
    proxy.mode = "pass"


def _copied(bed: Bed, _fault: ExitStack) -> None:
    """A file manager's copy beside a segment."""
    path = next((bed.folder / "state").glob("spool-*/*.seg"))
    shutil.copy(path, path.with_name(f"{path.stem} (copy).seg"))


def _deleted(bed: Bed, _fault: ExitStack) -> None:
    shutil.rmtree(next((bed.folder / "state").glob("spool-*")))


def _cut_off(bed: Bed, _fault: ExitStack) -> None:
    """A rotation of logs copies the spool's file and cuts it off."""
    os.truncate(max((bed.folder / "state").glob("spool-*/*.seg")), 0)


def _power_cut(bed: Bed, fault: ExitStack) -> None:
    """What a power cut leaves: a run without an end, and another id of the computer's start; no sink answers."""
    bed.sink.stop()
    fault.callback(bed.sink.start)
    bed.daemon.kill()
    for path in (bed.folder / "state").glob("energy-*.json"):
        content = orjson.loads(path.read_bytes())
        content["run"]["start"] = "00" * 15 + "01"
        path.write_bytes(orjson.dumps(content))
    bed.daemon.start()


def _spool_full(bed: Bed, fault: ExitStack) -> None:
    proxy = bed.proxies["daemon"]
    proxy.mode = "refuse"
    proxy.reset()
    bed.disks["spool"].fill()
    fault.callback(bed.disks["spool"].free)


def _errors(*calls: str) -> Begin:
    """The daemon's disk answers errors to some calls."""

    def begin(bed: Bed, fault: ExitStack) -> None:
        bed.refusals["daemon"].answer(errno.ESTALE, *calls)
        fault.callback(bed.refusals["daemon"].answer, 0)

    return begin


def _daemon_ahead(bed: Bed, _fault: ExitStack) -> None:
    assert bed.clock is not None
    bed.clock.set(2 * 86_400.0)


def _daemon_behind(bed: Bed, _fault: ExitStack) -> None:
    assert bed.clock is not None
    bed.daemon.stop()
    bed.clock.set(-40 * 86_400.0)
    bed.daemon.start()


def _taken(*statements: str) -> Begin:
    """An administrator of the server does this, and ends the sessions of the sink."""

    def begin(bed: Bed, _fault: ExitStack) -> None:
        as_administrator(bed, *statements, DISCONNECT)

    return begin


def _log_disk_full(bed: Bed, fault: ExitStack) -> None:
    bed.disks["log"].fill()
    fault.callback(bed.disks["log"].free)
    use_up_log(bed)


def _dropped(bed: Bed, _fault: ExitStack) -> None:
    """Somebody's trigger drops rows without an error."""
    with bed.engine.begin() as connection:
        connection.exec_driver_sql("CREATE TRIGGER d BEFORE INSERT ON power_row BEGIN SELECT RAISE(IGNORE); END")


def _sink_behind(bed: Bed, _fault: ExitStack) -> None:
    assert bed.sink_clock is not None
    bed.sink.stop()
    bed.sink_clock.set(-2 * 86_400.0)
    bed.sink.start()


def _idle_subscribers(bed: Bed, fault: ExitStack) -> None:
    """Clients that subscribe to all rows and read nothing, and a way to the sink that takes 3 s."""
    for k in range(_IDLE):
        client = paho.Client(CallbackAPIVersion.VERSION2, client_id=f"idle{k}")
        client.connect("127.0.0.1", bed.port)
        client.subscribe("acqd/#", qos=1)
        for _ in range(3):
            client.loop_write()
        fault.callback(client.disconnect)
    bed.proxies["sink"].latency_s = 3.0


def _broker_silent(bed: Bed, _fault: ExitStack) -> None:
    for proxy in bed.proxies.values():
        proxy.mode = "silent"


CASES = (
    Case("rows refused and acknowledged, until stored", _refused_rows, "daemon", "^rows refused: .*acqd/cell1/"),
    Case("the same, until acknowledged", _refused_rows, "daemon", "^rows refused: .*acqd/cell1/", "acknowledged"),
    Case("device renamed while rows wait", _renamed, "daemon", "^spool: .* rows of device cell1 wait in"),
    Case("empty replica", _empty_server, "sink", "its tables are gone: empty", database="postgres"),
    Case("two daemons of one name", _two_daemons, "daemon", r"name taken: .* \(boot \w+, since \d{4}-"),
    Case("commits take seconds", _slow_commits, "sink", "^database (slow|away)"),
    Case("500 idle subscribers, slow way to the sink", _idle_subscribers, "daemon", "^receipts late|^no receipt"),
    Case("SQLite file moved away", _moved, "sink", "moved away or deleted"),
    Case("SQLite file replaced", _replaced, "sink", "was replaced|another database|earlier state"),
    Case("spool cannot be read", _unreadable, "daemon", "^spool: .*cannot be (read|opened)"),
    Case("a copy among the spool's files", _copied, "daemon", "^spool: .*copy.*is no file of this spool"),
    Case("the spool's folder deleted", _deleted, "daemon", "somebody deleted or changed files of the spool"),
    Case("a file of the spool cut off", _cut_off, "daemon", "somebody deleted or changed files of the spool"),
    Case("daemon's power cut, sink away", _power_cut, "daemon", "power cuts? before this start"),
    Case("spool's disk full, broker away", _spool_full, "daemon", "^spool: .*[Nn]o space", need="disks"),
    Case("spool's disk takes nothing", _errors("write", "stat"), "daemon", "^spool: .*[Ss]tale", need="refusals"),
    Case("spool's disk confirms nothing", _errors("sync"), "daemon", "^spool: .*does not confirm", need="refusals"),
    Case("energy register not written", _errors("rename"), "daemon", "^energy register: ", need="refusals"),
    Case("daemon's clock two days ahead", _daemon_ahead, "sink", "in quarantine, .*clock", need="clock"),
    Case("sink's clock two days behind", _sink_behind, "sink", "this computer's clock", need="clock"),
    Case("daemon's clock 40 days behind", _daemon_behind, "daemon", "^this computer's clock says", need="clock"),
    Case("rows dropped by a trigger", _dropped, "sink", "leaves out rows .* without an error"),
    Case(
        "rights of the sink's role taken", _taken(f"REVOKE INSERT ON power FROM {ROLE}"), "sink",
        "^database away: .*permission denied for table power", database="postgres",
    ),
    Case(
        "server read-only", _taken("ALTER DATABASE postgres SET default_transaction_read_only = on"), "sink",
        "^database away: .*read-only transaction", database="postgres",
    ),
    Case(
        "disk of the server's log full", _log_disk_full, "sink", "^database away: ", database="postgres", need="disks",
    ),
    Case(
        "database renamed", database_renamed, "sink", "^database away: .*does not exist", database="postgres",
    ),
    Case("schema renamed", schema_renamed, "sink", "^database away: .*its tables are gone", database="postgres"),
    Case("role wants a password", password_wanted, "sink", "^database away: .*password", database="postgres"),
    Case("disk of the database read-only", read_only("database"), "sink", "^database away: ", need="disks"),
    Case("disk of the spool read-only", read_only("state"), "daemon", "^spool: Read-only file system", need="disks"),
    Case(
        "broker takes small packets only", broker_set_to(SMALL_PACKETS), "daemon",
        "^(broker away|name taken): .*max_packet_size",
    ),
    Case(
        "broker takes small messages only", broker_set_to(SMALL_MESSAGES), "daemon",
        "^rows refused: .*message_size_limit",
    ),
    Case("broker's certificate of another CA", _other_ca, "daemon", "^broker away: .*certificate", tls=True),
    Case("broker silent", _broker_silent, "daemon", "broker away"),
)  # fmt: skip
