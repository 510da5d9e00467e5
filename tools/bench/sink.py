"""The sink compared with a raw bulk insert into its database, and end to end through mosquitto."""

from __future__ import annotations

import gc
import sqlite3
import statistics
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import paho.mqtt.client as paho
from paho.mqtt.enums import CallbackAPIVersion

from acqd.storage.database import open_database
from acqd.storage.received import Received
from acqd.storage.sink import Sink
from acqd.storage.sink_settings import SinkSettings
from acqd.storage.writer import Writer
from acqd.telemetry.mqtt import BrokerAddress
from acqd.telemetry.row import CHANNELS, PowerRow
from acqd.timestamps import filetime, rfc3339
from tools.bench.report import Figure
from tools.common.servers import mosquitto, postgres

_ROWS, _BATCH, _ROUNDS = 40_000, 2_000, 5
_COLUMNS = '"device","channel","boot","seq","time","filetime","Vrms","Irms","P","S","PF","f","W","flags","schema"'


def _rows(boot: str, number: int = 0) -> list[PowerRow]:
    """A boot begins where the one before has ended: two that overlap are two daemons of one name, and flagged."""
    names, windows = CHANNELS, _ROWS // 4
    times = [(number * windows + k) * 40_000_000 for k in range(windows)]
    stamps = [(rfc3339(time), filetime(time)) for time in times]
    return [
        PowerRow(
            "cell1",
            names[k % 4],
            boot,
            k // 4,
            *stamps[k // 4],
            230.1 + k,
            1.2,
            270.3,
            276.1,
            0.98,
            50.01,
            k * 1e-6,
            [],
        )
        for k in range(_ROWS)
    ]


class Speed(NamedTuple):
    """Rows per second."""

    passed: float
    """Of time, which also the disk and others take."""
    spent: float
    """Of CPU time of this thread."""


def _timed(work: Callable[[list[Any]], object], items: list[Any]) -> Speed:
    gc.freeze()  # no collection looks through the messages of the benchmark
    begun, spent = time.perf_counter(), time.thread_time()
    for start in range(0, len(items), _BATCH):
        work(items[start : start + _BATCH])
    spent = time.thread_time() - spent
    return Speed(len(items) / (time.perf_counter() - begun), len(items) / spent)


def _plain(row: PowerRow) -> tuple[Any, ...]:
    values = (row.Vrms, row.Irms, row.P, row.S, row.PF, row.f, row.W)
    return (row.device, row.channel, row.boot, row.seq, row.time, row.filetime, *values, "[]", row.schema)


def _numbered(row: PowerRow, run: int) -> tuple[Any, ...]:
    number = run << 34 | row.seq << 2 | CHANNELS.index(row.channel)
    return (number, 1, row.filetime, row.Vrms, row.Irms, row.P, row.S, row.PF, row.f, row.W)


Round = Callable[[int], Speed]
"""The round of a number."""


def _alternating(ours: Round, raw: Round) -> tuple[float, float, float, float]:
    """Medians of both and of their ratios: what else the computer does slows both of a round."""
    rounds = [(ours(k), raw(k)) for k in range(_ROUNDS)]
    return (
        statistics.median(one.passed for one, _ in rounds),
        statistics.median(other.passed for _, other in rounds),
        statistics.median(one.passed / other.passed for one, other in rounds),
        statistics.median(one.spent / other.spent for one, other in rounds),
    )


def _ours(url: str) -> Round:
    """The sink's writer, from payloads to committed rows."""
    writer = Writer(open_database(url))

    def measure(number: int) -> Speed:
        messages = [Received(f"acqd/cell1/{r.channel}/power", r.to_json()) for r in _rows(f"ours{number}", number)]
        return _timed(writer.write, messages)

    return measure


def _raw_sqlite(path: Path) -> Round:
    """executemany of ready tuples: the same table, batches and bytes.

    One commit per batch, on the disk when it returns (WAL, synchronous=FULL), as the sink's.
    """
    connection = sqlite3.connect(path)
    connection.execute("PRAGMA synchronous=FULL")
    statement = f"INSERT INTO power_row VALUES ({','.join('?' * 10)})"

    def insert(batch: list[Any]) -> None:
        connection.executemany(statement, batch)
        connection.commit()

    return lambda number: _timed(insert, [_numbered(r, 100 + number) for r in _rows("raw", number)])


def _raw_postgres(connection: Any) -> Round:
    """COPY of ready tuples: the same table and batches, one commit per batch."""

    def insert(batch: list[Any]) -> None:
        with connection.cursor() as cursor, cursor.copy(f"COPY power ({_COLUMNS}) FROM STDIN") as copy:
            for values in batch:
                copy.write_row(values)
        connection.commit()

    return lambda number: _timed(insert, [_plain(r) for r in _rows(f"raw{number}", number)])


def _end_to_end(url: str) -> float:
    """Rows/s from mosquitto into the table: the broker holds a backlog when the sink starts."""
    engine = open_database(url)
    messages = [(f"acqd/cell1/{r.channel}/power", r.to_json()) for r in _rows("mqtt", _ROUNDS)]
    settings = SinkSettings(client_id="bench")
    with mosquitto() as port:
        stopped = threading.Event()
        address = BrokerAddress(port=port)
        _run_until(Sink(address, engine, settings), stopped, lambda sink: sink.connected)
        client = paho.Client(CallbackAPIVersion.VERSION2)
        client.max_inflight_messages_set(5_000)
        client.connect("127.0.0.1", port)
        client.loop_start()
        infos = [client.publish(topic, payload, qos=1) for topic, payload in messages]
        for info in infos:
            info.wait_for_publish(60)
        client.loop_stop()
        begun = time.perf_counter()
        _run_until(Sink(address, engine, settings), stopped, lambda sink: sink.counters.rows >= _ROWS)
        return _ROWS / (time.perf_counter() - begun)


def _run_until(sink: Sink, stopped: threading.Event, done: Callable[[Sink], bool]) -> None:
    stopped.clear()
    thread = threading.Thread(target=sink.run, args=(stopped.is_set,))
    thread.start()
    deadline = time.monotonic() + 120
    while not done(sink) and time.monotonic() < deadline:
        time.sleep(0.01)
    stopped.set()
    thread.join()


def sinks() -> Iterator[Figure]:
    """From payloads to committed rows, in transactions of 2000."""
    import psycopg

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "b.sqlite"
        speeds = _alternating(_ours(str(path)), _raw_sqlite(path))
        yield from _figures("SQLite", speeds, "executemany", _end_to_end(str(path)))
    with postgres() as url, psycopg.connect(url) as connection:
        speeds = _alternating(_ours(url), _raw_postgres(connection))
        yield from _figures("PostgreSQL", speeds, "COPY", _end_to_end(url))


def _figures(name: str, speeds: tuple[float, float, float, float], how: str, end_to_end: float) -> Iterator[Figure]:
    section, (ours, raw, ratio, spent) = f"sink into {name}", speeds
    yield Figure(section, "payloads checked, written, committed", ours, "rows/s", ">= 20000")
    yield Figure(section, f"raw bulk insert ({how} of ready tuples)", raw, "rows/s")
    yield Figure(section, "ratio; both commit to the disk and wait for it", ratio, "", ">= 0.5")
    yield Figure(section, "ratio by the CPU time of this thread; JSON is read by the sink alone", spent, "")
    yield Figure(
        section, "a backlog of 40000 rows through mosquitto, everything included", end_to_end, "rows/s", ">= 8000"
    )
