"""Rows of many devices through one mosquitto and sinks into a database: sent, stored, and what that takes."""

from __future__ import annotations

import multiprocessing
import socket
import struct
import subprocess
import tempfile
import threading
import time
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, suppress
from dataclasses import dataclass
from multiprocessing.synchronize import Event
from pathlib import Path

import psutil
import sqlalchemy as sa

from acqd.daemon.health.query import ask
from acqd.daemon.health.section import HealthSection
from acqd.storage.database import open_database
from acqd.storage.schema import power
from acqd.telemetry import wire
from acqd.telemetry.ports import free_port
from acqd.telemetry.row import CHANNELS, PowerRow
from acqd.telemetry.wire import V311, Hello
from acqd.timestamps import filetime, rfc3339
from tools.common.commands import acqd_command
from tools.common.servers import mosquitto

DEVICES, WINDOW_S = 50, 0.04
BEGIN_S = 1_700_000_000
"""Unix time of the first rows."""


@dataclass(frozen=True, slots=True)
class LoadRun:
    """What came of one load."""

    lost: int
    rate: float
    """rows/s from the first to the last stored row."""
    cpu: dict[str, float]
    """CPU time by program, as a share of the time from the first to the last stored row [% of a core]."""

    def us_per_row(self) -> float:
        """CPU time of all programs for one row [us]."""
        return 1e4 * sum(self.cpu.values()) / self.rate


def run_load(url: str, boot: str, sinks: int, windows: int, every_s: float) -> LoadRun:
    """Send `windows` of all devices, one every `every_s` or as fast as it goes, and wait until they are stored."""
    sent = windows * DEVICES * 4
    with mosquitto() as port, ExitStack() as stack, tempfile.TemporaryDirectory() as folder:
        asked = [_start_sink(stack, Path(folder), k, port, url, sinks) for k in range(sinks)]
        time.sleep(4.0)  # the sinks subscribe
        spawning = multiprocessing.get_context("spawn")
        counted = spawning.Event()
        sender = spawning.Process(target=_send, args=(port, boot, windows, every_s, counted))
        sender.start()
        while not _stored(asked):
            time.sleep(0.01)
        begun, before, stored = time.monotonic(), cpu_s(), 0
        changed = begun
        while stored < sent and time.monotonic() - changed < 20:
            time.sleep(0.05)
            if (now := _stored(asked)) > stored:
                stored, changed = now, time.monotonic()
        elapsed, after = changed - begun, cpu_s()
        counted.set()
        sender.join()
    cpu = {name: 100 * (after[name] - before[name]) / elapsed for name in after}
    return LoadRun(sent - _in_database(url, boot), stored / elapsed, cpu)


def _start_sink(stack: ExitStack, folder: Path, k: int, port: int, url: str, sinks: int) -> HealthSection:
    """Start a sink that ends with the stack; where it can be asked for its rows."""
    health = HealthSection(sink_port=free_port())
    path = folder / f"{k}.toml"
    group = 'group = "g"\n' if sinks > 1 else ""
    path.write_text(
        f"[mqtt]\nport = {port}\n[health]\nsink_port = {health.sink_port}\n"
        f'[sink]\ndatabase = "{url}"\nclient_id = "s{k}"\n{group}'
    )
    sink = subprocess.Popen(
        acqd_command("sink", "--config", path), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    stack.callback(sink.wait)
    stack.callback(sink.terminate)
    return health


def _send(port: int, boot: str, windows: int, every_s: float, counted: Event) -> None:
    """Publish with QoS 1; where there is no pause between the windows, all packets are made beforehand."""
    made: Iterable[bytes] = (b"".join(packets(boot, k)) for k in range(windows))
    if not every_s:
        made = list(made)
    with socket.create_connection(("127.0.0.1", port)) as sock:
        hello = Hello(V311, f"load-{boot}", 0, None, None, "load/will", b"", 0, 0, 1 << 16)
        sock.sendall(wire.connect(hello))
        threading.Thread(target=_discard, args=(sock,), daemon=True).start()
        begun = time.monotonic()
        for k, data in enumerate(made):
            sock.sendall(data)
            time.sleep(max(0.0, begun + k * every_s - time.monotonic()) if every_s else 0.0)
        counted.wait()  # a process that has ended has no CPU time


def _discard(sock: socket.socket) -> None:
    with suppress(OSError):  # closed at the end
        while sock.recv(1 << 16):
            pass


def packets(boot: str, k: int) -> Iterator[bytes]:
    """Window `k` of all devices."""
    ns = BEGIN_S * 10**9 + k * 40_000_000
    values = (230.1, 1.2, 270.3, 276.1, 0.98, 50.01, k * 1e-6)
    for device in range(DEVICES):
        for n, channel in enumerate(CHANNELS):
            row = PowerRow(f"d{device}", channel, boot, k, rfc3339(ns), filetime(ns), *values, [])
            number = (4 * (k * DEVICES + device) + n) % 65_535 + 1
            yield _publish(f"acqd/d{device}/{channel}/power".encode(), row.to_json(), number)


def _publish(topic: bytes, payload: bytes, number: int) -> bytes:
    """PUBLISH of MQTT 3.1.1 with QoS 1."""
    body = struct.pack("!H", len(topic)) + topic + struct.pack("!H", number) + payload
    return b"\x32" + bytes([len(body) & 0x7F | 0x80, len(body) >> 7]) + body  # 128 to 16383 bytes


def _stored(sinks: list[HealthSection]) -> int:
    """Rows that the sinks say they have stored: to count them in the database would cost it much."""
    answers = [ask(section, "sink") for section in sinks]
    return sum(answer.status.get("rows", 0) for answer in answers if answer is not None)


def _in_database(url: str, boot: str) -> int:
    engine = open_database(url)
    with engine.connect() as connection:
        count = connection.execute(sa.select(sa.func.count()).where(power.c.boot == boot)).scalar()
    engine.dispose()
    return int(count or 0)


def cpu_s() -> dict[str, float]:
    """CPU time of the programs that this process has started [s]."""
    spent = {"sinks": 0.0, "PostgreSQL": 0.0, "mosquitto": 0.0, "the sender": 0.0}
    for process in psutil.Process().children(recursive=True):
        with suppress(psutil.NoSuchProcess):
            times = process.cpu_times()
            ended = times.children_user + times.children_system  # connections of PostgreSQL that are closed
            spent[_program(process)] += times.user + times.system + ended
    return spent


def _program(process: psutil.Process) -> str:
    name = process.name()
    if name in ("mosquitto", "postgres"):
        return "PostgreSQL" if name == "postgres" else name
    return "sinks" if "sink" in process.cmdline() else "the sender"
