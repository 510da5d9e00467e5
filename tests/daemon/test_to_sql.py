"""From the spool into SQL, through a real broker that dies: every row once, none lost."""

from __future__ import annotations

import asyncio
import itertools
import signal
import sqlite3
import subprocess
from contextlib import contextmanager

import numpy as np
import psycopg
import pytest
import sqlalchemy as sa
from msgspec import structs

from acqd.daemon.config import Config
from acqd.daemon.uplink import Uplink
from acqd.storage.database import engine_for, open_database
from acqd.storage.schema import power, power_event, power_quality, quarantine
from acqd.telemetry.broker import free_port
from acqd.telemetry.mqtt import BrokerAddress
from acqd.telemetry.quality_row import quality_rows
from acqd.telemetry.spool import Readings, Spool, SpooledRow, Stream
from tests.commands import ACQD
from tests.metering.quality.waves import metered, three_phases
from tests.storage.rows import count, row
from tests.storage.test_events import event
from tests.storage.test_sink import publish, publisher, running_sink
from tests.waiting import LIMIT_S, finish, until, wait_for


class Daemon:
    """The uplink of a daemon, and a tape of its rows."""

    def __init__(self, folder, port, rows="channel", **spool):
        mqtt = {"port": port, "rows": rows}
        config = Config(device="cell1", state_dir=folder, mqtt=mqtt, spool=spool)
        self.uplink = Uplink(config, ["cell1"], lambda: b'{"state":"online"}')
        self.tape = []

    async def make(self, windows, every_s=0.0):
        for _ in range(windows):
            k = len(self.tape) // 2
            rows = [row(k, channel) for channel in ("L1", "total")]
            self.tape += rows
            self.uplink.put(rows, [], Readings([(0.001 * k, 0.0)]))
            await asyncio.sleep(every_s)

    async def delivered(self):
        await until(lambda: not self.uplink.counters().waiting, "every row has its receipt")

    async def stop(self, tasks):
        assert not any(task.done() for task in tasks), "the daemon ends when one of its tasks does"
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        self.uplink.close()


def stored(engine):
    with engine.connect() as connection:
        query = sa.select(power.c.channel, power.c.seq, power.c.W).order_by(power.c.seq, power.c.channel)
        return [tuple(one) for one in connection.execute(query)]


def taped(daemon):
    return sorted([(one.channel, one.seq, one.W) for one in daemon.tape], key=lambda one: (one[1], one[0]))


@contextmanager
def sink(mosquitto, engine, **settings):
    with running_sink(BrokerAddress(port=mosquitto.port), engine, **settings) as running:
        yield running


def kill(mosquitto, *, forgets):
    """kill -9; a broker without persistence forgets sessions and queues."""
    mosquitto.process.kill()
    mosquitto.process.wait()
    if forgets:
        (mosquitto.folder / "mosquitto.db").unlink(missing_ok=True)


def test_the_daemon_comes_first_and_the_sink_later(mosquitto, database, tmp_path, monkeypatch, caplog):
    monkeypatch.setattr("acqd.daemon.uplink._NO_SINK_S", 0.0)
    monkeypatch.setattr("acqd.daemon.uplink._SYNC_S", 0.05)
    engine = open_database(database)

    async def scenario():
        daemon = Daemon(tmp_path, mosquitto.port)
        tasks = daemon.uplink.tasks()
        await daemon.make(200, 0.002)
        assert daemon.uplink.counters().waiting == 400 and not daemon.uplink.counters().sink_seen
        assert caplog.text.count("no sink has been seen") == 1
        with sink(mosquitto, engine):
            await daemon.make(50, 0.002)
            await daemon.delivered()
        assert stored(engine) == taped(daemon)
        await daemon.stop(tasks)

    finish(scenario())


@pytest.mark.parametrize("rows", ["channel", "window"])
def test_rows_of_power_quality_survive_an_outage_too(mosquitto, tmp_path, rows):
    engine = open_database(str(tmp_path / "a.sqlite"))
    t = np.arange(8_000) / 4_000
    values = metered(three_phases(2 * np.pi * 50 * t), 4_000.0)
    made = [one for k, value in enumerate(values) for one in quality_rows(value, "cell1", "boot1", k)]

    async def scenario():
        daemon = Daemon(tmp_path, mosquitto.port, rows)
        tasks = daemon.uplink.tasks()
        with sink(mosquitto, engine):
            daemon.uplink.put_quality(made[:12])
            await daemon.make(5)
            await daemon.delivered()
            await asyncio.to_thread(kill, mosquitto, forgets=True)
            daemon.uplink.put_quality(made[12:])
            await daemon.make(5)
            await asyncio.to_thread(mosquitto.start)
            await daemon.delivered()
        assert stored(engine) == taped(daemon)
        await daemon.stop(tasks)

    finish(scenario())
    with engine.connect() as connection:
        found = connection.execute(sa.select(power_quality.c.channel, power_quality.c.seq)).all()
    assert sorted(found) == sorted((one.channel, one.seq) for one in made)


@pytest.mark.parametrize(("forgets", "rows"), [(True, "channel"), (False, "channel"), (True, "window")])
def test_a_broker_that_is_killed_again_and_again_costs_no_row(mosquitto, tmp_path, forgets, rows):
    """Also within seconds of the first subscription of the sink, which no broker has written down by then."""
    engine = open_database(str(tmp_path / "a.sqlite"))

    async def scenario():
        daemon = Daemon(tmp_path, mosquitto.port, rows)
        tasks = daemon.uplink.tasks()
        with sink(mosquitto, engine):
            for kills, pause in enumerate((0.05, 0.6)):
                while daemon.uplink.counters().reconnects < kills:  # a busy computer may take longer
                    await daemon.make(1, 0.004)
                await daemon.make(100, 0.004)
                await asyncio.to_thread(kill, mosquitto, forgets=forgets)
                await daemon.make(20, 0.004)
                await asyncio.sleep(pause)
                await asyncio.to_thread(mosquitto.start)
            await daemon.make(50, 0.004)
            await daemon.delivered()
        assert stored(engine) == taped(daemon) and daemon.uplink.counters().reconnects == 2
        await daemon.stop(tasks)

    finish(scenario())


@pytest.mark.parametrize("rows", ["channel", "window"])
def test_events_survive_a_long_outage_and_a_restart_of_the_daemon(mosquitto, tmp_path, rows):
    engine = open_database(str(tmp_path / "a.sqlite"))
    told = [event(k, duration) for k in range(1_200) for duration in (None, 0.1)]

    async def scenario():
        mosquitto.stop()
        first = Daemon(tmp_path, mosquitto.port, rows)
        tasks = first.uplink.tasks()
        for one in told:
            first.uplink.put_event(one)
        await first.make(3)
        await first.stop(tasks)
        second = Daemon(tmp_path, mosquitto.port, rows)
        assert second.uplink.counters().waiting == 2_406
        tasks = second.uplink.tasks()
        await asyncio.to_thread(mosquitto.start)
        with sink(mosquitto, engine):
            await second.delivered()
        assert stored(engine) == taped(first)
        await second.stop(tasks)

    finish(scenario())
    with engine.connect() as connection:
        found = connection.execute(sa.select(power_event.c.number, power_event.c.duration)).all()
    assert sorted(found) == [(k, 0.1) for k in range(1_200)]
    assert count(engine, quarantine) == 0


def test_rows_survive_a_restart_of_the_daemon_and_of_the_sink(mosquitto, tmp_path):
    engine = open_database(str(tmp_path / "a.sqlite"))

    async def scenario():
        mosquitto.stop()
        first = Daemon(tmp_path, mosquitto.port)
        tasks = first.uplink.tasks()
        await first.make(150)
        await first.stop(tasks)
        second = Daemon(tmp_path, mosquitto.port)
        assert second.uplink.counters().waiting == 300 and second.uplink.readings("cell1").energy == [(0.149, 0.0)]
        tasks = second.uplink.tasks()
        await asyncio.to_thread(mosquitto.start)
        with sink(mosquitto, engine):
            await until(lambda: count(engine) > 0, "the first rows")
        with sink(mosquitto, engine):
            await second.delivered()
        assert stored(engine) == taped(first)
        await second.stop(tasks)

    finish(scenario())


def test_a_locked_database_stops_nothing_and_loses_nothing(mosquitto, postgres, tmp_path):
    open_database(postgres)
    engine = engine_for(postgres, impatient=True)

    async def scenario():
        daemon = Daemon(tmp_path, mosquitto.port)
        tasks = daemon.uplink.tasks()
        alive = []
        with sink(mosquitto, engine) as running, psycopg.connect(postgres) as other:
            await daemon.make(20, 0.002)
            await daemon.delivered()
            other.execute("LOCK TABLE power IN ACCESS EXCLUSIVE MODE")
            running._progress = lambda: alive.append(1)
            await daemon.make(300, 0.005)
            await until(lambda: len(alive) > 2, "the sink feeds its watchdog")
            assert daemon.uplink.counters().waiting == 600 and daemon.uplink.counters().reconnects == 0
            other.rollback()
            await daemon.delivered()
            assert running.counters.reconnects == 0
        assert stored(engine) == taped(daemon)
        await daemon.stop(tasks)

    finish(scenario())


def test_a_strangers_row_with_our_key_is_a_conflict_that_is_said(mosquitto, database, tmp_path, caplog):
    """Whoever comes first is stored; the other one is in quarantine, however often it comes, and blocks nothing."""
    engine = open_database(database)

    async def scenario():
        daemon = Daemon(tmp_path, mosquitto.port)
        with sink(mosquitto, engine) as running:
            with publisher(mosquitto.port) as client:
                foreign = [
                    structs.replace(row(5, "L1"), P=-1.0),
                    structs.replace(row(6, "total"), flags=["gap"]),
                ]
                await asyncio.to_thread(publish, client, [*foreign, row(7, "L1")])
                wait_for(lambda: running.counters.rows == 3, "the stranger's rows")
            tasks = daemon.uplink.tasks()
            await daemon.make(20)
            await daemon.delivered()
            assert running.counters.conflicts == 2 and "other rows with their keys" in caplog.text
            with publisher(mosquitto.port) as client:
                await asyncio.to_thread(publish, client, foreign + daemon.tape)
                wait_for(lambda: running.counters.rows >= 3 + 38 + 2 + 38, "all again")
        with engine.connect() as connection:
            entries = connection.execute(sa.select(quarantine.c.reason)).scalars().all()
        assert len(entries) == 2 and all("another row with this key" in reason for reason in entries)
        assert count(engine) == 40
        await daemon.stop(tasks)

    finish(scenario())


def test_rows_that_were_forged_in_advance_cost_no_genuine_row(mosquitto, tmp_path, monkeypatch):
    """The boot is public in the status topic: a stranger has rows stored whose numbers the daemon is about to send.

    The sink's receipts for them reach the daemon while its own rows still wait.
    """
    engine = open_database(str(tmp_path / "a.sqlite"))
    monkeypatch.setattr("acqd.telemetry.receipt_watch.AHEAD", 64)  # the backlog leaves in portions

    async def scenario():
        daemon = Daemon(tmp_path, mosquitto.port)
        await daemon.make(600)
        forged = [structs.replace(one, P=-1.0) for one in daemon.tape if one.seq >= 300]
        forged += [row(seq, "L1", P=-1.0) for seq in (10**6, 10**9)]
        with sink(mosquitto, engine) as running, publisher(mosquitto.port) as client:
            await asyncio.to_thread(publish, client, forged)
            await until(lambda: running.counters.rows == len(forged), "the forged rows are stored")
            tasks = daemon.uplink.tasks()
            await until(lambda: daemon.uplink.counters().connected, "the daemon connects")
            await asyncio.to_thread(publish, client, forged)  # once more, and with them their receipts
            await daemon.delivered()
            assert running.counters.conflicts >= 600
        with engine.connect() as connection:
            kept = connection.execute(sa.select(quarantine.c.payload)).scalars().all()
        assert sorted(kept) == sorted(one.to_json() for one in daemon.tape if one.seq >= 300)
        assert count(engine) == 600 + len(forged)
        await daemon.stop(tasks)

    finish(scenario())


def test_a_malformed_row_of_ours_is_quarantined_and_not_sent_for_ever(mosquitto, tmp_path):
    engine = open_database(str(tmp_path / "a.sqlite"))

    async def scenario():
        daemon = Daemon(tmp_path, mosquitto.port)
        tasks = daemon.uplink.tasks()
        with sink(mosquitto, engine):
            daemon.uplink.put([row(900, P=1e30), row(901, device="cell1", f=-2e15)], [], None)
            await daemon.make(3)
            await daemon.delivered()
        assert count(engine) == 6 and count(engine, quarantine) == 2
        await daemon.stop(tasks)

    finish(scenario())


def test_two_sinks_of_a_group_store_every_row_once(mosquitto, database, tmp_path):
    engine = open_database(database)

    async def scenario():
        daemon = Daemon(tmp_path, mosquitto.port)
        tasks = daemon.uplink.tasks()
        with sink(mosquitto, engine, client_id="one", group="g"):
            with sink(mosquitto, engine, client_id="two", group="g") as two:
                await daemon.make(150, 0.002)
                await until(lambda: two.counters.rows > 0, "the second sink has its share")
            await daemon.make(150, 0.002)
            await daemon.delivered()
        assert stored(engine) == taped(daemon)
        await daemon.stop(tasks)

    finish(scenario())


@pytest.mark.slow
def test_an_embedded_broker_that_is_killed_costs_no_row(tmp_path):
    """It keeps nothing on disk and speaks MQTT 3.1.1."""
    engine, port = open_database(str(tmp_path / "a.sqlite")), free_port()

    def start():
        broker = subprocess.Popen([*ACQD, "broker", "--port", str(port)], stdout=subprocess.PIPE)
        broker.stdout.readline()
        return broker

    async def scenario():
        daemon = Daemon(tmp_path, port)
        tasks = daemon.uplink.tasks()
        broker = await asyncio.to_thread(start)
        with running_sink(BrokerAddress(port=port), engine):
            for _ in range(3):
                await daemon.make(100, 0.01)
                broker.kill()
                await asyncio.to_thread(broker.wait)
                await daemon.make(50, 0.01)
                broker = await asyncio.to_thread(start)
            await daemon.make(50, 0.01)
            await daemon.delivered()
        assert stored(engine) == taped(daemon)
        await daemon.stop(tasks)
        broker.terminate()
        broker.wait()

    finish(scenario())


@pytest.mark.slow
def test_no_register_goes_back_after_a_kill(mosquitto, tmp_path):
    """kill -9 of `acqd run` at any moment: the registers continue where the last row was, also without their file."""
    (tmp_path / "acqd.toml").write_text(
        f'device = "cell1"\nstate_dir = "{tmp_path}"\n[mqtt]\nport = {mosquitto.port}\n'
        f'[sink]\ndatabase = "{tmp_path / "a.sqlite"}"\n[source]\npower = 2000.0\n[registers]\nenabled = true\n'
    )
    engine = open_database(str(tmp_path / "a.sqlite"))
    with sink(mosquitto, engine):
        for starts in (1, 2):
            daemon = subprocess.Popen([*ACQD, "run", "--config", str(tmp_path / "acqd.toml")])
            wait_for(lambda n=starts, d=daemon: d.poll() is not None or boots(tmp_path) >= n, "rows of this start")
            (daemon.kill if starts == 1 else daemon.terminate)()
            daemon.wait(LIMIT_S)
            (tmp_path / "energy-cell1.json").unlink()
    with sqlite3.connect(tmp_path / "a.sqlite") as connection:
        rows = connection.execute("SELECT W FROM power WHERE channel = 'L1' ORDER BY filetime").fetchall()
        quadrants = "W_reactive_I + W_reactive_II + W_reactive_III + W_reactive_IV"
        query = f"SELECT W_import, {quadrants}, boot, seq FROM power_register WHERE channel = 'total' ORDER BY filetime"
        registers = connection.execute(query).fetchall()
        boot, seq = registers[-1][2:]
        query = "SELECT W FROM power WHERE channel = 'total' AND boot = ? AND seq = ?"
        (W,) = connection.execute(query, (boot, seq)).fetchone()
    readings = [W for (W,) in rows]
    assert readings == sorted(readings) and readings[0] > 0
    assert registers[0][0] > 0 and registers[0][1] > 0 and len({boot for _, _, boot, _ in registers}) == 2
    for earlier, later in itertools.pairwise(registers):
        assert later[0] > earlier[0] and later[1] > earlier[1]
    assert registers[-1][0] == pytest.approx(W, rel=1e-12), "they are those after the window of the same key"


def boots(folder):
    with sqlite3.connect(folder / "a.sqlite") as connection:
        return connection.execute("SELECT count(DISTINCT boot) FROM power_register").fetchone()[0]


def test_rows_under_the_name_before_a_change_of_device_are_counted_by_the_daemon(tmp_path):
    old = Spool(tmp_path / "spool-old")
    old.append([SpooledRow(Stream("old", "L1", "b"), 0, b"{}")])
    old.close()

    async def scenario():
        daemon = Daemon(tmp_path, free_port())
        tasks = daemon.uplink.tasks()
        await until(lambda: daemon.uplink.counters().left_behind.startswith("1 rows of device old wait"), "the name")
        await daemon.stop(tasks)

    finish(scenario())


def test_rows_that_the_broker_refuses_and_acknowledges_wait_and_are_named(mosquitto, tmp_path, monkeypatch):
    """An access rule, MQTT 3.1.1, nobody who sends receipts."""
    monkeypatch.setattr("acqd.daemon.rights_watch._LOOK_S", 0.02)
    monkeypatch.setattr("acqd.daemon.rights_watch._REFUSED_S", 0.1)
    monkeypatch.setattr("acqd.daemon.rights_watch._AGAIN_S", 0.1)
    rules = mosquitto.folder / "acl"
    rules.write_text("topic readwrite acqd/+/status\n")
    mosquitto.stop()
    mosquitto.extra += f"acl_file {rules}\n"
    mosquitto.start()
    engine = open_database(str(tmp_path / "a.sqlite"))

    async def scenario():
        daemon = Daemon(tmp_path, mosquitto.port, until="acknowledged")
        tasks = daemon.uplink.tasks()
        await daemon.make(5)
        await until(lambda: daemon.uplink.counters().rights_trouble, "a refusal")
        assert "acqd/cell1/L1/power" in daemon.uplink.counters().rights_trouble
        await until(lambda: daemon.uplink.counters().delivered >= 10, "acknowledgements")
        assert daemon.uplink.counters().waiting == 10
        with sink(mosquitto, engine):
            rules.write_text("topic readwrite #\n")
            mosquitto.process.send_signal(signal.SIGHUP)
            await until(lambda: not daemon.uplink.counters().rights_trouble, "the broker takes rows again")
            await until(lambda: stored(engine) == taped(daemon), "every row is stored")
            await until(lambda: daemon.uplink.counters().waiting == 0, "every row is delivered")
            rules.write_text("topic readwrite acqd/+/status\n")
            mosquitto.process.send_signal(signal.SIGHUP)
            await daemon.make(20)
            await until(
                lambda: daemon.uplink.counters().rights_trouble, "a refusal by rules that changed during the connection"
            )
            rules.write_text("topic readwrite #\n")
            mosquitto.process.send_signal(signal.SIGHUP)
            await until(lambda: stored(engine) == taped(daemon), "rows that the broker acknowledged and refused")
            await daemon.make(2)
        await daemon.uplink.flush(5.0)
        assert daemon.uplink.counters().waiting == 0  # the last question is asked at the stop
        await daemon.stop(tasks)

    finish(scenario())
