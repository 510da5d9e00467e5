"""A database that is away when the sink starts; what is worth another try, and what is not."""

from __future__ import annotations

import signal
import sqlite3
import subprocess
from contextlib import contextmanager
from datetime import datetime

import pytest
import sqlalchemy as sa
from msgspec.structs import replace
from sqlalchemy.engine import make_url

from acqd.errors import UserError
from acqd.storage.away import DatabaseAwayError
from acqd.storage.database import engine_for, open_database, prepare, unanswered
from acqd.storage.schema import power
from acqd.storage.writer import Writer
from acqd.telemetry.broker import free_port
from tests.commands import ACQD, acqd_here
from tests.forwarded import forwarded
from tests.storage.postgres_double import refusing
from tests.storage.rows import count, message, row
from tests.storage.test_sink import publish, publisher
from tests.waiting import LIMIT_S, wait_for


@contextmanager
def sink_process(folder, port, url):
    """`acqd sink`, and its log."""
    log = folder / "sink.log"
    with log.open("w") as file:
        command = [*ACQD, "sink", "--port", str(port), "--database", url]
        process = subprocess.Popen(command, stderr=file, stdout=subprocess.DEVNULL)
    try:
        yield process, log
    finally:
        process.kill()
        process.wait(LIMIT_S)


def test_a_sink_that_starts_without_its_database_waits_for_it_and_loses_nothing(mosquitto, postgres, tmp_path):
    server, port = make_url(postgres), free_port()
    url = server.set(port=port).render_as_string(hide_password=False)
    with sink_process(tmp_path, mosquitto.port, url) as (process, log), publisher(mosquitto.port) as client:
        wait_for(lambda: "trying again" in log.read_text(), "the outage is said")
        wait_for(lambda: "connected to broker" in log.read_text(), "the sink connects to the broker")
        publish(client, [row(k) for k in range(300)])
        with forwarded(port, server.port):
            wait_for(lambda: "takes rows again" in log.read_text(), "the database is back")
            wait_for(lambda: count(open_database(postgres)) == 300, "the rows that waited")
            process.send_signal(signal.SIGTERM)
            assert process.wait(LIMIT_S) == 0
        text = log.read_text()
    assert text.count("trying again") == 1 and "Connection refused" in text and "Traceback" not in text


def test_a_database_that_cannot_be_used_once_it_is_back_ends_the_sink(mosquitto, tmp_path):
    port = free_port()
    url = f"postgresql://acqd:hush@127.0.0.1:{port}/acqd"
    with sink_process(tmp_path, mosquitto.port, url) as (process, log):
        wait_for(lambda: "trying again" in log.read_text(), "the outage is said")
        with refusing("28P01", "wrong", asks_password=True) as refused, forwarded(port, refused):
            assert process.wait(LIMIT_S) == 2
        text = log.read_text()
    assert "check host, port, user, password" in text and "hush" not in text and "Traceback" not in text


@pytest.mark.parametrize(
    ("code", "text", "asks_password", "away"),
    [
        ("28P01", "Passwort-Authentifizierung fehlgeschlagen", True, False),
        ("3D000", 'database "acqd" does not exist', True, False),
        ("28000", 'no pg_hba.conf entry for host "10.0.0.9"', False, False),
        ("57P03", "the database system is starting up", False, True),
        ("57P03", "das Datenbanksystem startet", False, True),
        ("53300", "sorry, too many clients already", False, True),
        ("53300", "remaining connection slots are reserved for roles with the SUPERUSER attribute", True, True),
    ],
)
def test_what_a_server_refuses_is_an_outage_or_not(code, text, asks_password, away):
    with refusing(code, text, asks_password=asks_password) as port:
        engine = engine_for(f"postgresql://acqd:hush@127.0.0.1:{port}/acqd")
        with pytest.raises(UserError, match=text[:20]) as error:
            prepare(engine)
    assert isinstance(error.value, DatabaseAwayError) == away
    assert "hush" not in str(error.value)


@pytest.mark.parametrize("host", ["127.0.0.1:1", "nowhere.invalid"])
def test_a_server_that_is_not_there_is_an_outage(host):
    with pytest.raises(DatabaseAwayError):
        prepare(engine_for(f"postgresql://acqd@{host}/acqd"))


def test_a_locked_file_is_an_outage_and_another_programs_file_is_not(tmp_path):
    path = tmp_path / "a.sqlite"
    engine = engine_for(str(path), impatient=True)
    prepare(engine)
    with sqlite3.connect(path) as other:
        other.execute("BEGIN IMMEDIATE")
        with pytest.raises(DatabaseAwayError) as error:
            prepare(engine)
    assert error.value.reason == "database is locked"
    (tmp_path / "b.sqlite").write_bytes(b"not a database, but somebody's file" * 100)
    with pytest.raises(UserError) as error:
        prepare(engine_for(str(tmp_path / "b.sqlite")))
    assert not isinstance(error.value, DatabaseAwayError)


@pytest.mark.parametrize(
    "url", ["postgresql://acqd:hu@sh@db/acqd", "postgresql//acqd:hush@db", "postgresql://acqd:hush@db:x/a"]
)
def test_a_mistyped_url_ends_the_sink_with_one_line_without_the_secret(url):
    done = acqd_here("sink", "--database", url)
    assert done.returncode == 2 and len(done.stderr.strip().splitlines()) == 1
    assert "hu@sh" not in done.stderr and "hush" not in done.stderr


@pytest.mark.parametrize("database", [":memory:", "sqlite://", "sqlite:///:memory:"])
def test_a_sink_keeps_no_rows_in_memory_only(database):
    """A receipt says that they are on a disk."""
    refused = acqd_here("sink", "--database", database)
    assert refused.returncode == 2 and "in memory only" in refused.stderr and refused.stderr.count("\n") == 1


def test_limits_of_time_hold_in_each_transaction_and_need_no_options_of_the_connection(postgres):
    """A pooler refuses options, and lends its connections for a transaction."""
    engine = engine_for(postgres, impatient=True)
    with engine.connect() as connection:
        names = ("statement_timeout", "lock_timeout", "idle_in_transaction_session_timeout")
        assert [connection.exec_driver_sql(f"SHOW {name}").scalar() for name in names] == ["30s", "5s", "30s"]
        connection.rollback()
        driver = connection.connection.driver_connection
        assert driver.prepare_threshold is None
        driver.autocommit = True
        assert driver.execute("SHOW statement_timeout").fetchone() == ("0",)
    engine.dispose()


@pytest.mark.parametrize(("setting", "kept"), [("off", "on"), ("local", "local"), ("remote_apply", "remote_apply")])
def test_a_commit_is_on_the_disk_whatever_the_role_is_set_to(postgres, setting, kept):
    """A receipt follows it; what is stricter than that stays."""
    engine = engine_for(
        make_url(postgres).set(query={"options": f"-c synchronous_commit={setting}"}).render_as_string(), impatient=True
    )
    with engine.connect() as connection:
        assert connection.exec_driver_sql("SHOW synchronous_commit").scalar() == kept
    engine.dispose()


@pytest.mark.parametrize("impatient", [False, True])
def test_times_and_numbers_are_read_whatever_role_and_database_are_set_to(postgres, impatient):
    engine = open_database(postgres)
    rows = [row(k) for k in range(2)]
    Writer(engine).write([message(one) for one in rows])
    options = "-c datestyle=German -c extra_float_digits=-15 -c timezone=America/St_Johns"
    asked = engine_for(make_url(postgres).set(query={"options": options}).render_as_string(), impatient=impatient)
    with asked.connect() as connection:
        found = connection.execute(sa.select(power.c.time, power.c.Vrms).order_by(power.c.seq)).all()
    assert [tuple(one) for one in found] == [(datetime.fromisoformat(one.time), one.Vrms) for one in rows]
    other = replace(rows[0], P=1.0)
    assert Writer(asked).write([message(one) for one in (other, rows[1])]).conflicts == 1
    for each in (engine, asked):
        each.dispose()


def test_a_role_without_rights_is_told_so(postgres):
    """Not that the database may be another program's; a viewer without the right gets a line, not a traceback."""
    engine = open_database(postgres)
    with engine.begin() as connection:
        connection.exec_driver_sql("DROP ROLE IF EXISTS reader")
        connection.exec_driver_sql("CREATE ROLE reader LOGIN")
    reader = make_url(postgres).set(username="reader").render_as_string()
    with pytest.raises(UserError, match=r"permission denied .*; give its role the right") as refused:
        open_database(reader)
    assert not isinstance(refused.value, DatabaseAwayError) and "another program" not in str(refused.value)
    with engine_for(reader).connect() as connection, pytest.raises(sa.exc.ProgrammingError) as caught:
        connection.exec_driver_sql("DELETE FROM quarantine")
    assert "give its role the right" in str(unanswered(caught.value))
