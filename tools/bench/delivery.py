"""Store and forward: two ways to keep rows on disk compared, and how fast a backlog and new rows reach SQL."""

from __future__ import annotations

import asyncio
import os
import sqlite3
import subprocess
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Protocol

import numpy as np

from acqd.daemon.config import Config
from acqd.daemon.uplink import Uplink
from acqd.telemetry.mqtt import BrokerAddress
from acqd.telemetry.row import CHANNELS, PowerRow
from acqd.telemetry.spool import Spool, SpooledRow, Stream, confirm
from acqd.telemetry.subscriber import Subscriber
from acqd.telemetry.wire import V311, Hello
from acqd.timestamps import filetime, rfc3339
from tools.bench.report import Figure
from tools.common.commands import acqd_command
from tools.common.delay import delayed
from tools.common.servers import mosquitto

_WINDOWS = 10_000
_STREAMS = [Stream("cell1", channel, "boot") for channel in CHANNELS]
_PAYLOAD = b"x" * 300
_BACKLOG, _LIVE_S = 40_000, 0.04


def stores() -> Iterator[Figure]:
    """A window of four rows appended so that a kill -9 loses nothing; rows read back; receipts of 25 windows."""
    kinds: list[tuple[str, Callable[[Path], _Store]]] = [("segment log", _LogStore), ("SQLite, WAL", _SqliteStore)]
    for name, make in kinds:
        section = f"spool as {name}, {_WINDOWS} windows of 4 rows"
        with tempfile.TemporaryDirectory(dir=".") as folder:
            store = make(Path(folder))
            before = _written()
            appended = _timed(_append_all, store) / _WINDOWS
            read = _timed(lambda each: each.read(), store) / (4 * _WINDOWS)
            receipts = _timed(_remove_all, store)
            store.close()
            written = (_written() - before) / (4 * _WINDOWS)
        yield Figure(section, "CPU time to append a window", appended * 1e6, "us")
        yield Figure(section, "CPU time to read a row", read * 1e6, "us")
        yield Figure(section, "CPU time for the receipts of 25 windows", receipts / (_WINDOWS / 25) * 1e6, "us")
        yield Figure(section, "bytes written per row of 300 bytes", written, "")


class _Store(Protocol):
    def append(self, k: int) -> None:
        """Window `k`."""

    def read(self) -> None:
        """All rows."""

    def remove(self, first: int, last: int) -> None:
        """Receipts of some windows."""

    def close(self) -> None:
        """Release files."""


class _LogStore(_Store):
    def __init__(self, folder: Path) -> None:
        self.spool = Spool(folder)

    def append(self, k: int) -> None:
        self.spool.append([SpooledRow(stream, k, _PAYLOAD) for stream in _STREAMS])
        if k % 20 == 19:
            confirm(self.spool.unconfirmed())

    def read(self) -> None:
        position = self.spool.start
        while position != self.spool.end:
            _, position = self.spool.read(position, 64, lambda _stream, _seq: True)

    def remove(self, first: int, last: int) -> None:
        for stream in _STREAMS:
            self.spool.remove(stream, first, last)

    def close(self) -> None:
        self.spool.close()


class _SqliteStore(_Store):
    """One commit a window into the page cache (synchronous=OFF) and the log to the disk every 20 windows."""

    def __init__(self, folder: Path) -> None:
        self.path = folder / "spool.sqlite"
        self.connection = sqlite3.connect(self.path, isolation_level=None)
        self.connection.execute("PRAGMA journal_mode=WAL")
        self.connection.execute("PRAGMA synchronous=OFF")
        self.connection.execute(
            "CREATE TABLE row (id INTEGER PRIMARY KEY, device, channel, boot, seq INTEGER, payload BLOB)"
        )
        self.connection.execute("CREATE INDEX key ON row (device, channel, boot, seq)")

    def append(self, k: int) -> None:
        self.connection.execute("BEGIN")
        self.connection.executemany(
            "INSERT INTO row (device, channel, boot, seq, payload) VALUES (?, ?, ?, ?, ?)",
            [(*stream, k, _PAYLOAD) for stream in _STREAMS],
        )
        self.connection.execute("COMMIT")
        if k % 20 == 19:
            file = os.open(f"{self.path}-wal", os.O_RDONLY)
            os.fdatasync(file)
            os.close(file)

    def read(self) -> None:
        last = 0
        query = "SELECT * FROM row WHERE id > ? ORDER BY id LIMIT 64"
        while rows := self.connection.execute(query, (last,)).fetchall():
            last = rows[-1][0]

    def remove(self, first: int, last: int) -> None:
        self.connection.execute("BEGIN")
        for stream in _STREAMS:
            where = "device = ? AND channel = ? AND boot = ? AND seq BETWEEN ? AND ?"
            self.connection.execute(f"DELETE FROM row WHERE {where}", (*stream, first, last))
        self.connection.execute("COMMIT")

    def close(self) -> None:
        self.connection.close()


def _append_all(store: _Store) -> None:
    for k in range(_WINDOWS):
        store.append(k)


def _remove_all(store: _Store) -> None:
    for k in range(0, _WINDOWS, 25):
        store.remove(k, k + 24)


def _timed(work: Callable[[_Store], None], store: _Store) -> float:
    begun = time.process_time()
    work(store)
    return time.process_time() - begun


def _written() -> int:
    lines = Path("/proc/self/io").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("wchar"))


def drains() -> Iterator[Figure]:
    """A backlog from the spool through mosquitto into SQLite, while new rows come at the usual rate."""
    for round_trip_s in (0.0, 0.2):
        section = f"backlog of {_BACKLOG} rows beside new ones, round trip {1000 * round_trip_s:.0f} ms"
        with mosquitto() as port, tempfile.TemporaryDirectory() as folder:
            rate, lateness, resent = asyncio.run(_drain(Path(folder), port, round_trip_s))
        yield Figure(section, "delivered, with receipts", rate, "rows/s", ">= 1300")
        yield Figure(section, "new row to another subscriber, p99", float(np.percentile(lateness, 99)), "s")
        yield Figure(section, "worst", max(lateness), "s", "<= 1")
        yield Figure(section, "rows sent twice", resent, "")


async def _drain(folder: Path, port: int, round_trip_s: float) -> tuple[float, list[float], int]:
    command = acqd_command("sink", "--port", port, "--database", folder / "a.sqlite")
    async with delayed(port, round_trip_s) as far:
        config = Config.model_validate({"device": "cell1", "state_dir": folder, "mqtt": {"port": far}})
        uplink = Uplink(config, ["cell1"], lambda: b"{}")
        for k in range(_BACKLOG // 4):
            uplink.put(_rows(k), [], None)
        sink = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        late: list[float] = []
        made: dict[int, float] = {}

        stopped = threading.Event()
        listener = threading.Thread(target=_listen, args=(port, made, late, stopped))
        listener.start()
        await asyncio.sleep(2.0)  # the sink subscribes
        tasks, begun, k = uplink.tasks(), time.monotonic(), _BACKLOG // 4
        while uplink.counters().waiting > 400 or len(late) < 25:
            if uplink.counters().connected:  # before that, a row is backlog
                made[k] = time.monotonic()
            uplink.put(_rows(k), [], None)
            k += 1
            await asyncio.sleep(_LIVE_S)
        rate = 4 * k / (time.monotonic() - begun)
        resent = uplink.counters().resent
        stopped.set()
        listener.join()
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        uplink.close()
        sink.terminate()
        sink.wait(10)
    return rate, late, resent


def _listen(port: int, made: dict[int, float], late: list[float], stopped: threading.Event) -> None:
    hello = Hello(V311, "bench-listener", 10, None, None, "bench/will", b"", 0, 0, 1 << 16)
    subscriber = Subscriber(BrokerAddress(port=port), hello)
    subscriber.connect()
    subscriber.subscribe("acqd/cell1/total/power")
    while not stopped.is_set():
        messages = subscriber.receive(0.05)
        now = time.monotonic()
        for message in messages:
            seq = int(message.payload.split(b'"seq":')[1].split(b",")[0])
            if seq in made:
                late.append(now - made.pop(seq))
        subscriber.acknowledge([message.number for message in messages])
    subscriber.close()


def _rows(k: int) -> list[PowerRow]:
    ns = time.time_ns()
    values = (230.1, 1.2, 270.3, 276.1, 0.98, 50.01, k * 1e-6)
    return [PowerRow("cell1", channel, "boot", k, rfc3339(ns), filetime(ns), *values, []) for channel in CHANNELS]
