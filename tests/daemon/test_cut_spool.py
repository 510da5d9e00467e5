"""Registers after a power cut, or a kill, that left rows in the spool: W of every later row is greater than theirs."""

from __future__ import annotations

import asyncio

import pytest

from acqd.daemon.config import Config
from acqd.daemon.register import RegisterFile, Run
from acqd.daemon.uplink import Uplink
from acqd.daemon.waveform_feed import WaveformFeed
from acqd.metering import StreamFormat
from acqd.telemetry import topics
from acqd.telemetry.ranges import Ranges
from acqd.telemetry.receipts import LastRow, Receipt, receipts
from acqd.telemetry.row import PowerRow
from acqd.telemetry.spool import Readings, Spool, SpooledRow, Stream, confirm
from acqd.telemetry.spool.left_behind import folder_of
from acqd.telemetry.spool.record import ENERGY, Window, records
from tests.waiting import finish

_STEP = 0.001
"""Energy of a window of every channel [kWh]."""


def _row(channel: str, seq: int) -> SpooledRow:
    W = _STEP * (seq + 1)
    row = PowerRow("cell1", channel, "b", seq, "2026-01-01T00:00:00Z", 0, 230.0, 1.0, 9.0, 230.0, 0.1, 50.0, W, [])
    return SpooledRow(Stream("cell1", channel, "b"), seq, row.to_json())


def _spooled(state_dir, windows):
    """A spool that was not closed, with so many windows of two phases; its file."""
    spool = Spool(folder_of(state_dir, "cell1"))
    for seq in range(windows):
        spool.append([_row("L1", seq), _row("L2", seq)], Readings([(_STEP * (seq + 1), 0.0)] * 2))
    confirm(spool.unconfirmed())
    (file,) = folder_of(state_dir, "cell1").glob("*.seg")
    kept = file.read_bytes()
    spool.close()
    file.write_bytes(kept)  # without the index of a spool that was closed
    return file


def _begins_at(config, sink_has: int | None, *, receipted: bool) -> list[float]:
    """W of every phase [kWh] from which a start continues."""

    begins: list[float] = []

    async def scenario():
        uplink = Uplink(config, ["cell1"], lambda: b"{}")
        try:
            uplink.started = [asyncio.current_task()]  # no connection
            feed = WaveformFeed(config, config.source, "new", lambda *_: None, uplink)
            if sink_has is not None:
                last = [LastRow(channel, "b", sink_has, _STEP * (sink_has + 1)) for channel in ("L1", "L2")]
                uplink._last_rows.answered("cell1", Receipt("sink", [], last=last, boot="b"))
                feed._before = await uplink.last_rows("cell1")
            if receipted:  # before MAIN_FAST is there, the sink has taken what waited in the spool
                stored = Ranges()
                stored.add(0, 99)
                for topic, payload in receipts("sink", {Stream("cell1", name, "b"): stored for name in ("L1", "L2")}):
                    uplink._delivery.received(topic, payload, retained=False)
            meter = feed._make_meter(StreamFormat(20_000.0, (1.0,) * 4))
            begins.extend(imported - exported for imported, exported in meter.energy.reading())
        finally:
            uplink.close()

    finish(scenario())
    return begins


@pytest.fixture
def config(tmp_path):
    return Config(device="cell1", state_dir=tmp_path, mqtt={"port": 1}, health={"port": 0})


@pytest.mark.parametrize("receipted", [False, True])
@pytest.mark.parametrize(("sink_has", "last"), [(None, 9), (5, 9), (9, 9), (12, 12)])
def test_a_sink_that_is_behind_the_spool_takes_no_energy_back(config, tmp_path, sink_has, last, receipted):
    _spooled(tmp_path, 10)
    cut = Run("b", 3, start="11" * 16)
    RegisterFile(tmp_path, "cell1").save([(_STEP * 4, 0.0)] * 2, None, cut)
    assert _begins_at(config, sink_has, receipted=receipted) == pytest.approx([_STEP * (last + 1)] * 2)


@pytest.mark.parametrize("killed", [False, True])
@pytest.mark.parametrize("sink_has", [None, 8])
def test_rows_whose_registers_a_torn_write_has_lost_count(config, tmp_path, sink_has, killed):
    """The write of the last window ended after its rows: the kernel writes page by page."""
    file = _spooled(tmp_path, 10)
    content = file.read_bytes()
    energies = [before for before, record in _records(content) if record.kind == ENERGY]
    file.write_bytes(content[: energies[-1]])
    run = Run("b", 3) if killed else Run("b", 3, start="11" * 16)
    RegisterFile(tmp_path, "cell1").save([(_STEP * 4, 0.0)] * 2, None, run)
    assert _begins_at(config, None if killed else sink_has, receipted=True) == pytest.approx([_STEP * 10] * 2)


def _records(content):
    offset = 16
    for record in records(content, offset):
        yield offset, record
        offset = record.end


def test_a_closed_segment_says_which_window_its_registers_follow(tmp_path):
    spool = Spool(tmp_path / "s")
    spool.append([_row("L1", 7)], Readings([(1.0, 0.0)]))
    spool.append([SpooledRow(Stream("cell1", topics.register_stream("L1"), "b"), 9, b"{}")])
    spool.remove(Stream("cell1", "L1", "b"), 7, 7)
    spool.close()
    again = Spool(tmp_path / "s")
    assert again.readings("cell1").after == Window("b", 7) and again.unread("cell1") == []
    again.close()
