"""Many devices through one mosquitto into PostgreSQL: what sinks store, at what cost, and that nothing is lost."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator

import sqlalchemy as sa

from acqd.metering import SampleBlock
from acqd.metering.quality.meter import QualityMeter
from acqd.storage.database import open_database
from acqd.storage.keyed_rows import insert
from acqd.storage.maintain import Retention, maintain
from acqd.storage.schema import power, power_quality
from acqd.telemetry.quality_row import quality_rows
from tools.bench.load_run import BEGIN_S, DEVICES, WINDOW_S, cpu_s, packets, run_load
from tools.bench.report import Figure
from tools.bench.waves import hard_mains
from tools.common.servers import postgres

_STEADY_S, _ROWS_AT_ONCE = 30.0, 200_000
_SLOW_S, _ROWS_SLOWLY = 0.2, 60_000
_SIZE = "SELECT pg_total_relation_size('{table}')"
_COUNT = "SELECT count(*) FROM {table}"
_QUALITY_S, _BOOTS = 12.0, 10
"""Seconds of power quality, and how often they are stored."""
_LOG = "SELECT pg_wal_lsn_diff(pg_current_wal_lsn(), '0/0')"


def loads() -> Iterator[Figure]:
    """50 devices of 25 rows/s and four channels; then as fast as it goes, with one sink and with two.

    The cores of one computer limit both together, so the two are also compared where the database is slow.
    """
    yield from steady(_STEADY_S)
    with postgres() as url:
        yield from _compared(url, "flood", _ROWS_AT_ONCE, "", ">= 8000")
        _slow_down(url)
        slow = f", transactions that take {_SLOW_S} s longer"
        yield from _compared(url, "slow", _ROWS_SLOWLY, slow, ">= 1.6")


def steady(seconds: float) -> Iterator[Figure]:
    """50 devices of 25 rows/s and four channels: CPU of all that takes part, and what a row costs in PostgreSQL."""
    section = f"{DEVICES} devices, {DEVICES * 4 / WINDOW_S:.0f} rows/s for {seconds:.0f} s into PostgreSQL"
    sent = int(seconds / WINDOW_S) * DEVICES * 4
    with postgres() as url:
        engine = open_database(url)
        log = _number(engine, _LOG)
        run = run_load(url, "steady", 1, int(seconds / WINDOW_S), WINDOW_S)
        yield Figure(section, "rows sent", sent, "")
        yield Figure(section, "rows lost", run.lost, "", "<= 0")
        yield Figure(section, "stored", run.rate, "rows/s")
        for name, percent in run.cpu.items():
            yield Figure(section, f"CPU of {name}", percent, "% of a core", "<= 100" if name == "sinks" else "")
        yield Figure(
            section,
            "a row in PostgreSQL, with its indices",
            _number(engine, _SIZE.format(table="power")) / sent,
            "bytes",
        )
        yield Figure(section, "a row in PostgreSQL's log", (_number(engine, _LOG) - log) / sent, "bytes")
        yield Figure(section, "a row as a packet of MQTT", len(next(packets("steady", 0))), "bytes")
        with engine.begin() as connection:
            connection.exec_driver_sql("ANALYZE power")  # as a database has done that runs for longer
        work: dict[str, Callable[[], object]] = {
            "roll-ups (acqd sink maintain)": lambda: maintain(engine, Retention(), BEGIN_S + seconds + 3_600),
            "deletion": lambda: _delete_all(engine),
        }
        for name, run_once in work.items():
            begun, before = time.monotonic(), _processor_s()
            run_once()
            yield Figure(section, f"{name}, time per row", 1e6 * (time.monotonic() - begun) / sent, "us")
            yield Figure(section, f"{name}, CPU time per row", 1e6 * (_processor_s() - before) / sent, "us")
        yield from _other_rows(engine, section)
        engine.dispose()


def _other_rows(engine: sa.Engine, section: str) -> Iterator[Figure]:
    """Sizes of roll-ups that are made, and of rows of power quality (10-cycle values of three phases, simulated)."""
    wave = hard_mains(50.02, 3, _QUALITY_S)
    values = list(QualityMeter(wave.form).feed(SampleBlock(wave.codes, 0, BEGIN_S * 10**9)))
    with engine.begin() as connection:
        for boot in range(_BOOTS):
            made = [row for k, one in enumerate(values) for row in quality_rows(one, "d0", str(boot), k)]
            rows = [row for row in made if row.aggregation == "10/12"]
            insert(connection, power_quality, rows)
    yield Figure(
        section, "a row of power quality as a message", sum(len(row.to_json()) for row in rows) / len(rows), "bytes"
    )
    for name, table in {
        "a row of power quality": "power_quality", "a one-minute roll-up": "power_1min",
        "a quarter-hour roll-up": "power_15min",
    }.items():  # fmt: skip
        size = _number(engine, _SIZE.format(table=table)) / _number(engine, _COUNT.format(table=table))
        yield Figure(section, f"{name} in PostgreSQL, with its index", size, "bytes")


def _processor_s() -> float:
    """CPU time of this process and of PostgreSQL so far: other work of the computer does not count [s]."""
    return time.process_time() + cpu_s()["PostgreSQL"]


def _delete_all(engine: sa.Engine) -> None:
    with engine.begin() as connection:
        connection.execute(sa.delete(power))


def _number(engine: sa.Engine, query: str) -> int:
    with engine.connect() as connection:
        return int(connection.exec_driver_sql(query).scalar_one())


def _compared(url: str, boot: str, rows: int, how: str, target: str) -> Iterator[Figure]:
    """`rows` as fast as they go into one sink, then into two; `target` of the rate with one, or of the ratio."""
    runs = []
    for sinks in (1, 2):
        section = f"{rows} rows at once, {sinks} sink{'s' * (sinks > 1)}{how}"
        run = run_load(url, f"{boot}{sinks}", sinks, rows // (4 * DEVICES), 0.0)
        runs.append(run)
        yield Figure(section, "rows lost", run.lost, "", "<= 0")
        yield Figure(section, "stored", run.rate, "rows/s", target if sinks == 1 and not how else "")
        for name, percent in run.cpu.items():
            yield Figure(section, f"CPU of {name}", percent, "% of a core")
        yield Figure(section, "CPU of all together per row", run.us_per_row(), "us")
    one, two = runs
    yield Figure(section, "rate, compared with one sink", two.rate / one.rate, "", target if how else "")
    cores = len(os.sched_getaffinity(0))
    yield Figure(section, f"rate at which {cores} cores are busy", 1e6 * cores / one.us_per_row(), "rows/s")


def _slow_down(url: str) -> None:
    """A database with slow disks: every insertion waits, without using the processor."""
    engine = open_database(url)
    with engine.begin() as connection:
        connection.exec_driver_sql(
            "CREATE FUNCTION wait() RETURNS trigger LANGUAGE plpgsql AS "
            f"$$ BEGIN PERFORM pg_sleep({_SLOW_S}); RETURN NULL; END $$"
        )
        connection.exec_driver_sql(
            "CREATE TRIGGER wait AFTER INSERT ON power FOR EACH STATEMENT EXECUTE FUNCTION wait()"
        )
    engine.dispose()
