"""The campaign of faults: its judge must see what it is there to see."""

from __future__ import annotations

import contextlib
import errno
import json
import os
import socket
import subprocess
import sys
import threading

import pytest
from msgspec.structs import replace

from acqd.storage.database import open_database
from acqd.storage.writer import Writer
from acqd.telemetry.spool import Spool, SpooledRow, Stream
from tests.places import ROOT
from tests.storage.rows import message, row
from tools.studies.faults import clock, disk, refusals
from tools.studies.faults.bed import Extras, Kind
from tools.studies.faults.faults import possible
from tools.studies.faults.memory import how, limited, unit_limit
from tools.studies.faults.named import Named
from tools.studies.faults.proxy import Proxy
from tools.studies.faults.reconcile import missing, reconcile

NOTHING = dict.fromkeys(
    ["lost", "unspooled", "cut_short", "duplicated", "wrong", "unflagged", "backwards", "energy_back", "quarantined"], 0
)


def at(seq, **changes):
    return row(seq, t=1_700_000_000 + 0.04 * seq, **changes)


def reconciled(tmp_path, taped, stored):
    tape = tmp_path / "tape"
    tape.write_bytes(b"".join(one.to_json() + b"\n" for one in taped) + b'{"torn')
    engine = open_database(str(tmp_path / "a.sqlite"))
    Writer(engine).write([message(one) for one in stored])
    result = reconcile([tape], engine)
    assert result.made == len(taped) and result.stored == len(stored)
    assert missing([tape], engine) == result.lost + result.unspooled
    return {name: getattr(result, name) for name in NOTHING}


def test_rows_that_all_arrived_are_all_right(tmp_path):
    rows = [at(k, channel=channel) for k in range(20) for channel in ("L1", "total")]
    assert reconciled(tmp_path, rows, rows) == NOTHING


ROWS = [at(k) for k in range(6)]
EARLIER = replace(ROWS[2], filetime=ROWS[0].filetime - 10_000_000)
REBORN = [ROWS[4], replace(ROWS[5], boot="b2", W=0.0)]
KILLED = [ROWS[3], ROWS[4], replace(ROWS[5], boot="b2", W=0.0035)]


@pytest.mark.parametrize(
    ("taped", "stored", "found"),
    [
        (ROWS, ROWS[:2] + ROWS[4:], {"lost": 2}),
        (ROWS, [*ROWS[:5], replace(ROWS[5], W=9.0)], {"wrong": 1}),
        (ROWS, [*ROWS[:5], replace(ROWS[5], flags=["late"])], {"wrong": 1}),
        (ROWS, [*ROWS, replace(ROWS[5], boot="b2")], {"wrong": 1, "duplicated": 1}),
        (ROWS[:2] + ROWS[4:], ROWS[:2] + ROWS[4:], {"unflagged": 1}),
        ([*ROWS[:2], replace(ROWS[4], flags=["gap"])], [*ROWS[:2], replace(ROWS[4], flags=["gap"])], {}),
        ([*ROWS[:2], EARLIER], [*ROWS[:2], EARLIER], {"backwards": 1}),
        (REBORN, REBORN, {"energy_back": 1}),
        (KILLED, KILLED[::2], {"unspooled": 1, "cut_short": 1}),
        (ROWS, ROWS[:2], {"unspooled": 4, "cut_short": 1}),
        ([*ROWS, at(40, flags=["gap"])], ROWS[:2], {"lost": 5}),
        ([*ROWS, replace(at(6), boot="boot1.1")], [*ROWS[:5], replace(at(6), boot="boot1.1")], {"lost": 1}),
    ],
)  # fmt: skip
def test_every_kind_of_damage_is_counted(taped, stored, found, tmp_path):
    assert reconciled(tmp_path, taped, stored) == NOTHING | found


def test_rows_that_wait_in_the_spool_are_not_lost(tmp_path):
    tape, spool = tmp_path / "tape", Spool(tmp_path / "spool-t")
    tape.write_bytes(b"".join(one.to_json() + b"\n" for one in ROWS))
    for one in ROWS[4:5]:
        spool.append([SpooledRow(Stream(one.device, one.channel, one.boot), one.seq, one.to_json())])
    spool.close()
    engine = open_database(str(tmp_path / "a.sqlite"))
    Writer(engine).write([message(one) for one in ROWS[:3]])
    result = reconcile([tape], engine, state_dir=tmp_path)
    assert (result.waiting, result.lost, result.unspooled) == (1, 1, 1)


@pytest.fixture
def echo():
    """A server behind a proxy that sends back what it receives."""
    server = socket.create_server(("127.0.0.1", 0))

    def serve():
        while True:
            try:
                connection, _ = server.accept()
            except OSError:
                return
            with connection, contextlib.suppress(ConnectionError):
                while data := connection.recv(100):
                    connection.sendall(data)

    threading.Thread(target=serve, daemon=True).start()
    proxy = Proxy(server.getsockname()[1])
    yield proxy
    proxy.close()
    server.close()


def connect(proxy):
    client = socket.create_connection(("127.0.0.1", proxy.port), timeout=60)
    client.sendall(b"a")
    return client, client.recv(1)


def test_the_proxy_passes_resets_and_refuses(echo):
    client, answer = connect(echo)
    assert answer == b"a"
    echo.reset()
    with pytest.raises(ConnectionResetError):
        client.recv(1)
    echo.mode = "refuse"
    with contextlib.suppress(ConnectionError):
        assert connect(echo)[1] == b""
    echo.mode = "pass"
    assert connect(echo)[1] == b"a"


def test_a_half_open_connection_is_silent_and_then_goes_on(echo):
    client, _ = connect(echo)
    echo.mode = "silent"
    client.sendall(b"b")
    client.settimeout(0.2)
    with pytest.raises(TimeoutError):
        client.recv(1)
    echo.mode = "pass"
    client.settimeout(60)
    assert client.recv(1) == b"b"


def campaign(*options):
    command = [sys.executable, "-m", "tools.studies.faults", "--short", "--json", *options]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    [figures] = json.loads(done.stdout)
    assert figures["lost"] == figures["not recovered"] == figures["died"] == 0
    assert figures["cut short"] <= figures["daemon kills"]
    assert figures["wrong"] == figures["duplicated"] == figures["unflagged"] == figures["backwards"] == 0
    return figures


@pytest.mark.minutes
def test_the_status_names_every_fault_in_time():
    command = [sys.executable, "-m", "tools.studies.faults", "--named", "--json"]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, check=False)
    assert [one for one in json.loads(done.stdout) if not one["good"]] == []


@pytest.mark.parametrize(("seconds", "good"), [(0.3, True), (10.0, True), (10.1, False), (None, False)])
def test_a_fault_that_is_named_late_or_never_fails(seconds, good):
    assert Named("x", seconds, "").good == good


@pytest.mark.slow("daemon", "storage")
def test_three_faults_of_the_campaign():
    named = ("daemon killed", "broker killed", "sink: half-open")
    options = (word for name in named for word in ("--only", name))
    assert campaign("--faults", "3", *options)["faults"] == 3


@pytest.mark.minutes
def test_the_short_campaign():
    figures = campaign()
    assert figures["faults"] == 10 and figures["made"] > 500


def test_rows_behind_forged_ones_have_to_be_in_quarantine(tmp_path):
    tape, forged, engine = tmp_path / "tape", tmp_path / "forged", open_database(str(tmp_path / "a.sqlite"))
    tape.write_bytes(b"".join(one.to_json() + b"\n" for one in ROWS))
    false = [replace(one, P=1e6) for one in (ROWS[3], ROWS[4])]
    forged.write_bytes(b"".join(one.to_json() + b"\n" for one in false))
    Writer(engine).write([message(one) for one in [*ROWS[:3], *false, ROWS[5]]])
    assert reconcile([tape], engine, forged).lost == 2
    Writer(engine).write([message(ROWS[3])])
    result = reconcile([tape], engine, forged)
    assert (result.lost, result.contested, result.wrong) == (1, 1, 0)


@pytest.mark.parametrize("kind", [Kind("mosquitto", "sqlite"), Kind("embedded", "postgres")])
def test_a_bed_gets_only_faults_that_it_can_have(kind):
    plain, whole = set(possible(kind, Extras())), set(possible(kind, Extras(clock=True, disks=True, sidecar=True)))
    assert whole - plain >= {"clock set", "database disk full", "spool disk full", "sidecar killed"}
    assert ("database crashed" in plain) == (kind.database == "postgres")


def test_limits_come_from_the_units():
    assert unit_limit("acqd-broker") == 512 << 20 and unit_limit("acqd-sidecar") == 1 << 30
    code = "import resource; print(resource.getrlimit(resource.RLIMIT_DATA)[0])"
    done = subprocess.run(limited([sys.executable, "-c", code], 300 << 20), capture_output=True, text=True, check=True)
    assert int(done.stdout) == 300 << 20 or "RLIMIT_DATA" not in how()


@pytest.mark.minutes
@pytest.mark.skipif(bool(disk.missing()), reason=disk.missing())
def test_nothing_older_than_a_second_is_lost_in_a_power_cut():
    command = [sys.executable, "-m", "tools.studies.faults.power_cut", "--postgres", "0", "--json"]
    done = subprocess.run([*command, "--sqlite", "1", "--daemon", "1"], cwd=ROOT, capture_output=True, check=False)
    assert done.returncode == 0, done.stderr.decode()
    found = json.loads(done.stdout)
    assert [each["kind"] for each in found] == ["sqlite", "daemon"] and all(each["good"] for each in found)


def test_a_disk_answers_errors_to_the_calls_that_are_named_and_to_no_other_folder(tmp_path):
    if refusals.missing():
        pytest.skip(refusals.missing())
    disk_ = refusals.Refusals(tmp_path / "answers", tmp_path / "here")
    (tmp_path / "here").mkdir()
    disk_.answer(errno.ESTALE, "stat", "sync")
    program = (
        "import os\n"
        "for place in ('here', '.'):\n"
        "    file = os.open(place + '/a', os.O_RDWR | os.O_CREAT)\n"
        "    for call in (os.fstat, os.fsync, lambda f: os.write(f, b'x'), os.close):\n"
        "        try:\n            call(file)\n            print('-', end='')\n"
        "        except OSError as error:\n            print(error.errno, end=' ')\n"
    ).replace("'here'", f"'{tmp_path}/here'")
    environment = os.environ | disk_.environment()
    done = subprocess.run(
        [sys.executable, "-S", "-c", program], cwd=tmp_path, env=environment, capture_output=True, text=True, check=True
    )
    assert done.stdout == f"{errno.ESTALE} {errno.ESTALE} ------"


@pytest.mark.skipif(bool(clock.missing() or refusals.missing()), reason="needs libfaketime and a C compiler")
def test_a_service_may_have_a_faked_clock_and_a_disk_that_answers_errors(tmp_path):
    """Each has a library of its own: without the clock's, libfaketime lets `time.sleep` fail."""
    faked = clock.FakedClock(tmp_path / "sink.clock").environment()
    both = faked | refusals.Refusals(tmp_path / "sink.refusals", tmp_path).environment(faked["LD_PRELOAD"])
    libraries = both["LD_PRELOAD"].split(":")
    assert len(set(libraries)) == 3
    subprocess.run([sys.executable, "-S", "-c", "import time; time.sleep(0.01)"], env=os.environ | both, check=True)
