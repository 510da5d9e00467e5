"""The daemon on the doubles, in real time: from the wire to SQL, and through an outage."""

from __future__ import annotations

import asyncio
import json
import sqlite3
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from acqd.daemon.archive.compare import Comparison, stored_rows
from acqd.daemon.archive.replay import chosen
from acqd.daemon.archive.replay import remade as remake_all
from acqd.daemon.archive.rows import remake
from acqd.daemon.source_sections import AdsSection
from acqd.metering import Meter
from acqd.plc.executive import Executive
from acqd.plc.realtime import RealtimeSettings
from acqd.telemetry.broker import free_port
from tests.commands import ACQD
from tests.doubles.ads import AdsProcess, unused_host
from tests.doubles.modbus import ModbusProcess
from tests.doubles.veth import may_create_veth
from tests.waiting import LIMIT_S, finish, until, wait_for
from tools.demo.devices import DEVICES, ON_ETHERNET

POWER = {"sv": 638_130.0}
"""W that the double's three phases take; the others 1271 W."""


def rows_of(database: Path, device: str, channel: str) -> list[sqlite3.Row]:
    with sqlite3.connect(database) as connection:
        connection.row_factory = sqlite3.Row
        if not connection.execute("SELECT 1 FROM sqlite_master WHERE name = 'power'").fetchall():
            return []  # the sink has yet to make it
        return list(connection.execute("SELECT * FROM power WHERE device=? AND channel=?", (device, channel)))


def whole(rows: list[sqlite3.Row]) -> list[sqlite3.Row]:
    """A busy machine may lose samples of a real-time stream: those windows say so, the others are right."""
    return [
        row
        for row in rows
        if set(json.loads(row["flags"])) <= {"simulated", "late", "unsynchronised"} and row["P"] is not None
    ]


def run_until(enough: Callable[[], bool], folder: Path, source: str, kept: str = "false") -> None:
    """The daemon until the database has what the test needs, then SIGTERM."""
    (folder / "acqd.toml").write_text(
        f'device = "box"\n[mqtt]\nport = {free_port()}\n[broker]\nembedded = true\n[sink]\nembedded = true\n'
        f'database = "{folder / "box.sqlite"}"\n[archive]\nenabled = {kept}\nfolder = "{folder / "kept"}"\n'
        f"keep_free_gb = 0.0\n[source]\nsimulated = true\n{source}"
    )
    log = folder / "log"
    with log.open("w") as stderr:
        command = [*ACQD, "run", "--config", str(folder / "acqd.toml")]
        daemon = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=stderr)
    try:
        wait_for(lambda: daemon.poll() is not None or enough(), "rows in the database")
    finally:
        daemon.terminate()
        code = daemon.wait(LIMIT_S)
    assert code == 0 and "Traceback" not in log.read_text(), log.read_text()


def remade(kept: Path, database: str) -> Comparison:
    """Stored rows against those that the archive of the same run gives."""
    there = chosen(kept, "box", None, None)
    first, last = there.segments[0].begin_ns, there.segments[-1].end_ns
    comparison = Comparison.of(stored_rows(database, "box", first, last))
    remake_all(there, None, None, lambda tasks: map(remake, tasks), None, comparison)
    return comparison


@pytest.mark.long(seconds=8)
@pytest.mark.parametrize(
    "kind",
    [pytest.param(kind, marks=[] if kind == "ethercat" else pytest.mark.slow) for kind in DEVICES if kind != "meters"],
)
def test_the_daemon_meters_every_wire_into_sql(kind, tmp_path):
    if kind in ON_ETHERNET and not may_create_veth():
        pytest.skip("veth pairs need CAP_NET_ADMIN (root)")

    def rows() -> list[sqlite3.Row]:
        return rows_of(tmp_path / "box.sqlite", "box", "total")

    with DEVICES[kind]() as source:
        run_until(lambda: len(whole(rows())) > 10, tmp_path, source, kept="true")
    made_again = remade(tmp_path / "kept", str(tmp_path / "box.sqlite"))
    assert made_again.same > 10 and not (made_again.different or made_again.not_archived)
    assert all("simulated" in json.loads(row["flags"]) for row in rows())
    np.testing.assert_allclose([row["P"] for row in whole(rows())], POWER.get(kind, 1271.06), rtol=1e-3)
    assert all(abs(row["f"] - 50.0) < 0.02 for row in whole(rows()) if row["f"] is not None)


@pytest.mark.slow
def test_rows_of_rms_meters_equal_their_registers(tmp_path):
    database = tmp_path / "box.sqlite"
    with ModbusProcess("meters", "--model", "em340", "--units", "1-2", "--swing", "0") as double:
        source = f'kind = "meters"\nhost = "127.0.0.1"\nport = {double.port}\ntimeout_s = 10.0\n'
        for unit in (1, 2):
            source += f'[[source.meters]]\nname = "m{unit}"\nprofile = "em340"\nunit = {unit}\npoll_s = 0.2\n'
        channels = [(f"m{unit}", channel) for unit in (1, 2) for channel in ("L1", "L3", "total")]
        run_until(lambda: all(len(rows_of(database, *one)) >= 3 for one in channels), tmp_path, source)
        for unit in (1, 2):
            values = double.do("values", unit=unit)
            for channel, phase in (("L1", "1"), ("L3", "3")):
                rows = rows_of(database, f"m{unit}", channel)
                assert [row["seq"] for row in rows] == sorted({row["seq"] for row in rows})
                for row in rows:
                    for ours, theirs in (("Vrms", "U"), ("Irms", "I"), ("P", "P"), ("S", "S"), ("PF", "PF")):
                        assert row[ours] == pytest.approx(values[f"{theirs}{phase}"], rel=1e-6)
                    assert {"rms_meter", "simulated"} <= set(json.loads(row["flags"]))
            total = rows_of(database, f"m{unit}", "total")[-1]
            assert total["P"] == pytest.approx(values["P"], rel=1e-6) and total["f"] == values["f"]
            assert total["W"] == pytest.approx(values["import_kwh"] - values["export_kwh"], abs=0.2)


def test_an_outage_shows_in_the_health_and_as_a_gap_and_the_daemon_goes_on():
    batches, seen = [], []

    async def scenario() -> None:
        with AdsProcess(unused_host(), clock="real") as double:
            section = AdsSection(kind="ads", host=double.host, ams_net_id=double.net_id)
            executive = Executive(section.spec(), Meter, batches.append, realtime=RealtimeSettings(priority=0))
            await executive.start()
            running = asyncio.create_task(executive.run())

            await until(lambda: sum(map(len, batches)) > 10, "rows")
            double.command(refuse_s=1.0, reset=True)
            await until(lambda: not executive.health.connected, "the loss is said")
            seen.append(executive.health.reason)
            await until(lambda: executive.health.connected, "the device is back")
            count = sum(map(len, batches))
            await until(lambda: sum(map(len, batches)) > count + 20, "rows again")
            assert executive.health.reconnects == 1 and executive.restarts == 0
            # Stopping does not wait for a device that is away.
            double.command(refuse_s=60.0, reset=True)
            await until(lambda: not executive.health.connected, "the second loss")
            await executive.stop()
            await asyncio.wait_for(running, LIMIT_S)
            executive.close()

    finish(scenario())
    assert seen[0] and "\n" not in seen[0]
    flags = [flags for batch in batches for flags in batch.flags[0]]
    seq = np.concatenate([batch.seq for batch in batches])
    jump = int(np.argmax(np.diff(seq))) + 1
    assert "gap" in flags[jump] or "gap" in flags[jump - 1]
