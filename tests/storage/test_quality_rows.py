"""Rows of power quality: from the meter to payload, message and table, on SQLite and on a real PostgreSQL."""

from __future__ import annotations

import dataclasses
import json
from dataclasses import replace

import numpy as np
import pytest
import sqlalchemy as sa

from acqd.metering.quality.values import LISTS, PHASE, SYSTEM
from acqd.storage.database import open_database
from acqd.storage.maintain import Retention, maintain
from acqd.storage.received import Received
from acqd.storage.schema import power_quality, quarantine
from acqd.storage.writer import CONFLICT, Writer
from acqd.telemetry import topics
from acqd.telemetry.quality_row import LISTS as LIST_FIELDS
from acqd.telemetry.quality_row import NUMBERS, QualityRow, parse_quality, quality_rows
from acqd.telemetry.spool import Stream
from tests.metering.quality.waves import T0, metered, three_phases
from tests.storage.rows import count, message, row


@pytest.fixture(scope="module")
def made():
    """Rows of 11 s of three phases: all channels, "10/12", "150/180" and "10s"."""
    t = np.arange(11 * 4_000) / 4_000
    values = metered(three_phases(2 * np.pi * 50.0 * t), 4_000.0)
    return [one for k, value in enumerate(values) for one in quality_rows(value, "cell1", "boot1", k)]


def received(one: QualityRow) -> Received:
    return Received(f"acqd/cell1/{one.channel}/quality", one.to_json())


def test_every_quantity_has_a_field_and_every_field_a_column():
    quantities = {*PHASE, *SYSTEM, *LISTS, "f", "rocof", "PF", "DPF", "PFe"} - {"rotation"}
    assert quantities == {*NUMBERS, *LIST_FIELDS}
    fields = {field.name for field in dataclasses.fields(QualityRow)}
    assert fields == {column.name for column in power_quality.columns}


def test_rows_are_of_each_channel_and_read_back_equal(made):
    assert [one.channel for one in made[:4]] == ["L1", "L2", "L3", "total"]
    assert {one.aggregation for one in made} == {"10/12", "150/180", "10s"}
    for one in made:
        assert parse_quality(one.to_json()) == one
    phase, total = made[1], made[3]
    assert abs(phase.V1 - 230) < 0.01 and phase.Se is None
    assert len(phase.V_h) == 50 and phase.V_h[40] is None
    assert total.rotation == "L1-L2-L3" and total.PFe == pytest.approx(np.cos(0.5)) and total.V_h is None
    [ten] = [one for one in made if one.aggregation == "10s"][:1]
    assert ten.channel == "total" and ten.Vrms is None
    assert b"NaN" not in b"".join(one.to_json() for one in made)


def test_rows_are_stored_once_and_have_receipts_of_their_own(database, made):
    engine = open_database(database)
    writer = Writer(engine)
    sent = made[:8]
    written = writer.write([message(row(0)), *map(received, sent)])
    assert written.rows == 9 and written.quarantined == 0
    assert list(written.receipts[Stream("cell1", "L1/quality", "boot1")]) == [(0, 1)]
    assert list(written.receipts[Stream("cell1", "L1", "boot1")]) == [(0, 0)]
    assert writer.write([*map(received, made[4:12]), message(row(0))]).rows == 9
    assert count(engine, power_quality) == 12 and count(engine) == 1
    with engine.connect() as connection:
        query = sa.select(power_quality).where(power_quality.c.channel == "L2").order_by(power_quality.c.seq)
        stored = dict(connection.execute(query).mappings().first())
    expected = dataclasses.asdict(made[1])
    del stored["time"], expected["time"]
    assert stored == expected


def test_a_row_with_a_stored_key_and_other_values_goes_to_quarantine(database, made):
    engine = open_database(database)
    writer = Writer(engine)
    writer.write(list(map(received, made[:4])))
    other = replace(made[1], Vrms=made[1].Vrms + 1.0)
    lists = replace(made[2], V_h=[0.0] * 50)
    again = writer.write([received(one) for one in (made[0], other, lists, made[4], replace(made[4], f=49.0))])
    assert (again.rows, again.quarantined, again.conflicts) == (2, 3, 3)
    assert list(again.receipts[Stream("cell1", "L2/quality", "boot1")]) == [(0, 0)]  # sent once is enough
    with engine.connect() as connection:
        kept = connection.execute(sa.select(quarantine.c.payload, quarantine.c.reason)).all()
        stored = connection.execute(
            sa.select(power_quality.c.Vrms).where(power_quality.c.channel == "L2", power_quality.c.seq == 0)
        )
        assert stored.scalar() == made[1].Vrms
    assert {bytes(payload) for payload, _ in kept} == {
        one.to_json() for one in (other, lists, replace(made[4], f=49.0))
    }
    assert {reason for _, reason in kept} == {CONFLICT}


def test_malformed_rows_go_to_quarantine(database, made):
    engine = open_database(database)
    good = made[0]
    wrong = [
        Received("acqd/cell1/L2/quality", good.to_json()),
        Received("acqd/cell1/L1/power", good.to_json()),
        Received("acqd/cell1/L1/quality", row(0).to_json()),
        Received("acqd/cell1/L1/quality", b"[" * 1000),
        received(replace(good, V_h=[1.0] * 1000)),
        received(replace(good, aggregation="1h")),
        received(replace(good, time="yesterday")),
    ]
    written = Writer(engine).write([*wrong, received(good)])
    assert (written.rows, written.quarantined) == (1, 7)
    assert count(engine, power_quality) == 1 and count(engine, quarantine) == 7
    # Nobody can make them better by sending them again.
    assert Stream("cell1", "L1/quality", "boot1") in written.receipts


def test_short_aggregations_are_deleted_as_rows_are_and_long_ones_later(tmp_path, made):
    engine = open_database(str(tmp_path / "a.sqlite"))
    kinds = [replace(made[0], seq=k, aggregation=kind) for k, kind in enumerate(("10/12", "150/180", "10min", "2h"))]
    Writer(engine).write([received(one) for one in kinds])
    done = maintain(engine, Retention(30.0, 365.0, 30.0), now=T0 * 1e-9 + 40 * 86_400)
    assert done.power_deleted == 2 and count(engine, power_quality) == 2
    done = maintain(engine, Retention(30.0, 365.0, 30.0), now=T0 * 1e-9 + 400 * 86_400)
    assert done.rollup_deleted == 2 and count(engine, power_quality) == 0


def test_topics_of_streams():
    assert topics.row("d", "L1") == "acqd/d/L1/power"
    assert topics.row("d", topics.quality_stream("total")) == "acqd/d/total/quality"


def test_a_payload_is_below_what_a_sink_takes(made):
    assert max(len(one.to_json()) for one in made) < 8_000
    assert json.loads(made[0].to_json())["schema"] == 1
