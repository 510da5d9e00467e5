"""The service: killed, one at a time, its alarm on the broker."""

import asyncio
import json
import random
import shutil
import signal
import subprocess
import time
from unittest import mock

import paho.mqtt.client as paho
import pytest
import sqlalchemy as sa
from paho.mqtt.enums import CallbackAPIVersion
from sqlalchemy.engine import make_url

from acqd.sidecar.lock import exclusive
from acqd.sidecar.service import Sidecar
from acqd.sidecar.settings import Settings
from acqd.sidecar.store import Store
from acqd.sidecar.worker import Worker
from acqd.storage.database import open_database
from acqd.telemetry.broker import free_port
from tests.commands import ACQD
from tests.forwarded import forwarded
from tests.sidecar.cell import BEGIN, cell, motion, write_log
from tests.sidecar.runs import done_in, run, sidecar
from tests.waiting import LIMIT_S, wait_for


def test_one_sidecar_a_database_and_one_device(tmp_path, bundle, database):
    logs = tmp_path / "logs"
    logs.mkdir()
    cell(logs, database, 1)
    command = sidecar(logs, bundle, database, "--no-mqtt", "--until-idle")
    with exclusive(open_database(database)):
        second = run(command)
    assert second.returncode == 2 and "another sidecar works on this database" in second.stderr
    assert run(command).returncode == 0
    with open_database(database).begin() as connection:
        connection.exec_driver_sql("UPDATE power SET device = 'other' WHERE seq < 100")
    without = [word for word in command if word not in ("--device", "cell")]
    several = run(without)
    assert several.returncode == 2 and "choose one with --device: cell, other" in several.stderr


def test_a_sidecar_that_starts_without_its_database_waits_for_it(tmp_path, bundle, postgres):
    logs = tmp_path / "logs"
    logs.mkdir()
    open_database(postgres)
    cell(logs, postgres, 1)
    server, port, said = make_url(postgres), free_port(), tmp_path / "sidecar.log"
    away = server.set(port=port).render_as_string(hide_password=False)
    with said.open("w") as file:
        process = subprocess.Popen([*ACQD, *sidecar(logs, bundle, away, "--no-mqtt")], stderr=file)
    try:
        wait_for(lambda: "logs wait, trying again" in said.read_text(), "the outage is said")
        with forwarded(port, server.port):
            wait_for(lambda: len(done_in(postgres)[0]) == 1, "the log is done once the database is there")
            process.send_signal(signal.SIGTERM)
            assert process.wait(LIMIT_S) == 0
    finally:
        process.kill()
    text = said.read_text()
    assert text.count("trying again") == 1 and "the database answers" in text and "Traceback" not in text


def test_a_sidecar_that_waits_for_its_database_can_be_stopped_and_until_idle_does_not_wait(tmp_path, bundle):
    url, said = f"postgresql://acqd:hush@127.0.0.1:{free_port()}/acqd", tmp_path / "sidecar.log"
    command = sidecar(tmp_path, bundle, url, "--no-mqtt")
    with said.open("w") as file:
        process = subprocess.Popen([*ACQD, *command], stderr=file, stdout=subprocess.DEVNULL)
    try:
        wait_for(lambda: "trying again" in said.read_text(), "the outage is said")
        process.send_signal(signal.SIGTERM)
        assert process.wait(LIMIT_S) == 0
    finally:
        process.kill()
    once = run([*command, "--until-idle"])
    assert once.returncode == 2 and "check host, port" in once.stderr and "hush" not in once.stderr + said.read_text()


@pytest.mark.long(seconds=20)
def test_every_log_is_done_exactly_once_whoever_is_killed(tmp_path, bundle, mosquitto):
    url, logs, coming = str(tmp_path / "p.sqlite"), tmp_path / "logs", tmp_path / "coming"
    logs.mkdir()
    coming.mkdir()
    open_database(url)
    cell(coming, url, 3, rows=500)
    heard = []
    listener = paho.Client(CallbackAPIVersion.VERSION2)
    listener.on_connect = lambda c, *_: c.subscribe("acqd/cell/prediction", qos=1)
    listener.on_message = lambda _c, _d, message: heard.append(json.loads(message.payload))
    listener.connect("127.0.0.1", mosquitto.port)
    listener.loop_start()
    chance = random.Random(3)
    names = sorted(coming.iterdir())
    for number in range(3):
        process = subprocess.Popen(
            [*ACQD, *sidecar(logs, bundle, url, "--port", str(mosquitto.port))],
            stderr=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
        )
        shutil.move(names[number], logs / names[number].name)
        time.sleep(chance.uniform(1.5, 4.0))
        process.send_signal(signal.SIGKILL)
        process.wait()
    last = run(sidecar(logs, bundle, url, "--port", str(mosquitto.port), "--until-idle"))
    assert last.returncode == 0, last.stderr
    found, counts = done_in(url)
    assert sorted(found) == [path.name for path in names]
    assert all(status == "ok" and counts[name] == message["rows"] for name, (status, message) in found.items())
    wait_for(lambda: {each["log"] for each in heard} == set(found), "every log was published")
    listener.loop_stop()


@pytest.mark.long(seconds=8)
def test_a_change_raises_the_alarm_on_the_broker_and_is_kept(tmp_path, bundle, mosquitto):
    url, logs = str(tmp_path / "p.sqlite"), tmp_path / "logs"
    logs.mkdir()
    open_database(url)
    cell(logs, url, 7)
    cell(logs, url, 4, extra=6.0, first=7)
    result = run(sidecar(logs, bundle, url, "--port", str(mosquitto.port), "--until-idle"))
    assert "the residual has changed" in result.stderr
    kept = []
    client = paho.Client(CallbackAPIVersion.VERSION2)
    client.on_connect = lambda c, *_: c.subscribe("acqd/cell/prediction/alarm", qos=1)
    client.on_message = lambda _c, _d, message: kept.append(json.loads(message.payload))
    client.connect("127.0.0.1", mosquitto.port)
    client.loop_start()
    wait_for(lambda: kept, "the alarm is retained")
    client.loop_stop()
    assert abs(kept[0]["onset_s"] - (BEGIN + 420)) < 70
    found, _ = done_in(url)
    assert [message["drift"] for _, message in found.values()][-1] == "alarm"
    assert sum(message["alarm"] is not None for _, message in found.values()) == 1


def test_a_log_that_is_taken_away_while_its_power_is_waited_for_is_forgotten(tmp_path, bundle):
    url, logs = str(tmp_path / "p.sqlite"), tmp_path / "logs"
    logs.mkdir()
    engine = open_database(url)
    write_log(logs / "a.csv", motion(800, 0), BEGIN)
    service = Sidecar(
        logs, Worker(Settings(bundle, url, None, None, 0.0), engine), Store(engine), None, "c", live=False
    )

    async def take_twice():
        await service._read(logs / "a.csv")
        await service._take(logs / "a.csv")
        assert list(service._late) == [logs / "a.csv"]
        (logs / "a.csv").unlink()
        await service._take(logs / "a.csv")

    asyncio.run(take_twice())
    assert not service._late


def test_a_log_waits_while_the_database_does_not_answer(tmp_path, bundle, caplog):
    url, logs = str(tmp_path / "p.sqlite"), tmp_path / "logs"
    logs.mkdir()
    cell(logs, url, 1)
    engine = open_database(url)
    worker = Worker(Settings(bundle, url, "cell", None, 0.3), engine)
    service = Sidecar(logs, worker, Store(engine, "cell"), None, "cell", live=False)
    real, failures = worker._power_rows.of_span, [sa.exc.InterfaceError("", (), Exception("")), None]

    def of_span(*arguments):
        if (failure := failures.pop(0)) is not None:
            raise failure
        return real(*arguments)

    worker._power_rows.of_span = of_span
    with mock.patch("acqd.sidecar.service._DATABASE_RETRY_S", 0.0):
        asyncio.run(service.run(asyncio.Event(), lambda: None, until_idle=True))
    assert (service.done, service.refused) == (1, 0) and "trying again" in caplog.text
