"""Registers after a power cut."""

from __future__ import annotations

import asyncio
import json
import shutil

import pytest
import sqlalchemy as sa

from acqd.daemon import uplink
from acqd.daemon.config import Config
from acqd.daemon.continued import FLAG, continued, continued_from
from acqd.daemon.register import RegisterFile, Run
from acqd.daemon.service import Service
from acqd.daemon.tape import Tape
from acqd.daemon.waveform_feed import WaveformFeed
from acqd.metering import SampleBlock, StreamFormat
from acqd.storage.database import open_database
from acqd.storage.schema import power
from acqd.telemetry.last_rows import Known, Reading
from acqd.telemetry.mqtt import BrokerAddress
from acqd.telemetry.receipts import LastRow
from acqd.telemetry.spool import Readings
from acqd.telemetry.spool.record import Window
from tests.mains import make_mains
from tests.storage.test_sink import running_sink
from tests.waiting import finish, until, wait_for


@pytest.mark.parametrize(
    ("stored", "summary", "expected"),
    [
        (None, None, (5.0, 1.0)),
        (LastRow("L1", "b", 12, 4.5), None, (5.5, 1.0)),
        (LastRow("L1", "b", 12, 3.5), None, (5.0, 1.5)),  # it has exported since
        (LastRow("L1", "b", 10, 9.9), None, (5.0, 1.0)),  # no later than ours
        (None, Reading(11, 5.2, 1.1), (5.2, 1.1)),
        (LastRow("L1", "b", 12, 4.3), Reading(11, 5.2, 1.1), (5.4, 1.1)),
        (LastRow("L1", "b", 11, 4.3), Reading(12, 5.2, 1.1), (5.2, 1.1)),
    ],
)
def test_registers_continue_from_the_latest_row_that_anybody_knows(stored, summary, expected):
    known = Known("b", {"L1": stored} if stored else {}, {"L1": summary} if summary else {})
    assert continued([(5.0, 1.0)], 10, known) == [pytest.approx(expected)]


def test_what_is_known_of_another_boot_does_not_count():
    """The numbers of its rows say nothing: a box of a daemon was started again, or two starts followed each other."""
    others, unread = Known("b", {"L1": LastRow("L1", "b", 99, 0.5)}), [LastRow("L1", "b", 95, 0.7)]
    spooled = Readings([(5.0, 1.0)], None, Window("b", 90))
    assert continued_from([(5.0, 1.0)], Run("c", 3), spooled, others, unread) == [(5.0, 1.0)]
    assert continued_from([(5.0, 1.0)], Run("b", 3), spooled, others, []) == [pytest.approx((5.0, 4.5))]


def test_a_run_is_cut_off_when_the_computer_was_started_again_and_only_then(tmp_path):
    file = RegisterFile(tmp_path, "cell1")
    assert file.last_run() is None
    file.save([(1.0, 0.0)])
    assert file.last_run() is None, "of an earlier acqd"
    for run, cut_off in (
        (Run("b", 7), False),  # killed: the page cache has everything
        (Run("b", 7, start="00" * 16), True),
        (Run("b", 7, closed=True, start="00" * 16), False),
    ):
        file.save([(1.0, 0.0)], None, run)
        assert file.last_run() == run and run.cut_off == cut_off


def test_no_register_goes_back_when_the_daemons_computer_loses_power(mosquitto, tmp_path, monkeypatch):
    """The state_dir is as it was half a second before the last row, and the computer has another start."""
    engine = open_database(str(tmp_path / "a.sqlite"))
    disk, later, alone = (tmp_path / name for name in ("disk", "later", "alone"))

    def rows():
        with engine.connect() as connection:
            query = sa.select(power.c.boot, power.c.seq, power.c.W).where(power.c.channel == "L1")
            return connection.execute(query.order_by(power.c.filetime)).all()

    async def run(folder, work, tape=None):
        mqtt = {"port": mosquitto.port}
        config = Config(device="cell1", state_dir=folder, mqtt=mqtt, source={"power": 2000.0}, health={"port": 0})
        daemon = Service(config, tape=tape)
        running = asyncio.create_task(daemon.run())
        await work(daemon, lambda enough: until(lambda: running.done() or enough(), "rows"))
        daemon._stop.set()
        await running

    cuts: list[tuple[int, int]] = []

    async def cut(daemon, wait):
        await wait(lambda: len(rows()) >= 3)
        await asyncio.to_thread(daemon._feed.save)
        shutil.copytree(disk, later)
        before = len(rows())
        await wait(lambda: len(rows()) >= before + 6)

    async def go_on(daemon, wait):
        before = daemon.rows
        await wait(lambda: daemon.rows > before + 6 and daemon.counters().cuts)  # counters are up to a second old
        cuts.append((daemon.counters().cuts, daemon.counters().cuts_unconfirmed))

    with running_sink(BrokerAddress(port=mosquitto.port), engine):
        finish(run(disk, cut))
        register = later / "energy-cell1.json"
        state = json.loads(register.read_text())
        assert not state["run"]["closed"]
        register.write_text(json.dumps(state | {"run": state["run"] | {"start": "11" * 16}}))
        shutil.copytree(later, alone)
        finish(run(later, go_on, Tape(tmp_path / "tape")))
        assert FLAG not in (tmp_path / "tape").read_text()
        wait_for(lambda: len({row.boot for row in rows()}) == 2, "rows after the cut")
    made = rows()
    last = [row for row in made if row.boot == made[0].boot][-1]
    begin = next(row for row in made if row.boot != made[0].boot)
    assert [row.W for row in made] == sorted(row.W for row in made)
    assert 0 < begin.W - last.W < 2 * (last.W / (last.seq + 1)) + 1e-9, "the energy of one window, no more"

    monkeypatch.setattr(uplink, "_ANSWER_S", 0.0)
    finish(run(alone, go_on, Tape(tmp_path / "tape of alone")))
    flags = [json.loads(line)["flags"] for line in (tmp_path / "tape of alone").read_text().splitlines()]
    assert [FLAG in each for each in flags] == [True] * 4 + [False] * (len(flags) - 4), "no sink has answered"
    assert cuts == [(1, 0), (1, 1)]


def test_the_first_rows_say_that_the_register_could_not_be_read(tmp_path, caplog):
    """W begins at zero then: no power cut is known of, for the file holds nothing to ask with."""
    (tmp_path / "energy-cell1.json").write_text('{"registers": null, "ru')
    made, mains = [], make_mains(50.0, seconds=0.3, phases=1)
    config = Config(device="cell1", state_dir=tmp_path, mqtt={"enabled": False}, health={"port": 0})
    cut = WaveformFeed(config, config.source, "before", lambda *_: None)
    cut._make_meter(StreamFormat(mains.rate, mains.scale))  # and the power fails before its first row
    feed = WaveformFeed(config, config.source, "boot", lambda rows, *_: made.extend(rows))
    meter = feed._executive.meter = feed._make_meter(StreamFormat(mains.rate, mains.scale))
    for begin in range(0, 4_000, 800):
        feed._take(meter.feed(SampleBlock(mains.codes[begin : begin + 800], begin, 0)))
    assert [FLAG in row.flags for row in made] == [True] + [False] * 4
    feed.save()
    assert not RegisterFile(tmp_path, "cell1").last_run().unconfirmed
    assert (tmp_path / "energy-cell1.old").exists() and "unreadable" in caplog.text
