"""The statistics of EN 50160 of rows whose numbers are known, in a database as the sink fills it (simulated)."""

from __future__ import annotations

import json

import numpy as np
import pytest

from acqd.metering.quality.values import QualityValues
from acqd.storage.database import open_database
from acqd.storage.received import Received
from acqd.storage.writer import Writer
from acqd.telemetry import topics
from acqd.telemetry.event import PowerEvent
from acqd.telemetry.quality_row import quality_rows
from acqd.timestamps import filetime, rfc3339
from tests.commands import acqd_here

BEGIN = 1_750_032_000 * 10**9  # 2025-06-16T00:00:00Z
TENS = 144  # of a day


def values(kind, at_s, *, V=230.0, f=50.0, h5=3.0, flags=()):
    harmonics = np.zeros((3, 50))
    harmonics[:, 0], harmonics[:, 4] = V, V * h5 / 100
    phase, system = {}, {}
    if kind == "10min":
        powers = dict.fromkeys(("P", "S", "P1", "Q1"), np.ones(3))
        phase = {"Vrms": np.full(3, V), "V_h": harmonics, "V_thds": np.full(3, h5), **powers}
        system = {"V_u2": 0.5, "P": 3.0, "S": 3.0, "Se": 3.0, "P1": 3.0, "Q1": 3.0}
    elif kind == "Plt":
        phase = {"Plt": np.full(3, 0.4)}
    return QualityValues(
        kind, BEGIN + at_s * 10**9, 600.0, 1, f, 0.0, phase, system, frozenset({"simulated", *flags}),
        [frozenset()] * 3,
    )  # fmt: skip


def event(number, kind, at_s, duration, extreme):
    stamp = BEGIN + at_s * 10**9
    return PowerEvent(
        "cell1", "b", number, kind, rfc3339(stamp), filetime(stamp), duration, extreme, 230.0, False, None, ["L1"], [],
        None,
    )  # fmt: skip


@pytest.fixture(scope="module")
def database(tmp_path_factory):
    """A day: 10 of 144 values at 200 V, 4 more of a dip at 100 V, H5 of 7 % in 5 values, f 0.6 Hz off for 2 of 360."""
    path = tmp_path_factory.mktemp("week") / "acqd.sqlite"
    everything = []
    for k in range(TENS):
        V, flags = (200.0, ()) if k < 10 else (100.0, ("dip",)) if k < 14 else (230.0, ())
        everything.append(values("10min", 600 * k, V=V, h5=7.0 if 50 <= k < 55 else 3.0, flags=flags))
    everything += [values("10s", 10 * k, f=50.6 if k < 2 else 50.01) for k in range(360)]
    everything += [values("Plt", 7_200 * k) for k in range(12)]
    messages = [
        Received(topics.row("cell1", topics.quality_stream(row.channel)), row.to_json())
        for seq, one in enumerate(everything)
        for row in quality_rows(one, "cell1", "b", seq)
    ]
    events = [
        event(0, "dip", 100, 0.1, 170.0), event(1, "dip", 200, 3.0, 5.0), event(2, "interruption", 201, 2.0, 5.0),
        event(3, "swell", 300, 0.3, 260.0),
    ]  # fmt: skip
    messages += [Received(topics.event("cell1"), one.to_json()) for one in events]
    engine = open_database(str(path))
    assert Writer(engine).write(messages).quarantined == 0
    engine.dispose()
    return path


def report(database, *words):
    day = () if "--from" in words else ("--from", "2025-06-16", "--days", 1)
    return acqd_here("en50160", "--database", database, "--declared-voltage", 230, *day, *words)


@pytest.fixture(scope="module")
def told(database, tmp_path_factory):
    page = tmp_path_factory.mktemp("page") / "week.html"
    done = report(database, "--json", "--out", page)
    assert done.returncode == 1, done.stderr
    return json.loads(done.stdout), page.read_text()


def statistic(told, characteristic, channel, words=""):
    return next(
        one
        for one in told[0]["statistics"]
        if (one["characteristic"], one["channel"]) == (characteristic, channel) and words in one["requirement"]
    )


def test_voltage_is_judged_without_the_values_of_events(told):
    ninety_five = statistic(told, "voltage", "L2", "for 95 %")
    assert (ninety_five["values"], ninety_five["left_out"], ninety_five["expected"]) == (140, 4, 144)
    assert ninety_five["within"] == pytest.approx(130 / 140) and ninety_five["met"] is False
    always = statistic(told, "voltage", "L2", "always")
    assert always["met"] is True and always["low"] == 200  # 87 % of Un


def test_harmonics_flicker_unbalance_and_frequency(told):
    h5 = statistic(told, "harmonics", "L1", "H5 ")
    assert h5["within"] == pytest.approx(135 / 140) and h5["met"] is True and h5["p95"] == pytest.approx(3)
    assert statistic(told, "harmonics", "L1", "H11 ")["high"] == 0
    assert statistic(told, "flicker", "L3")["values"] == 12 and statistic(told, "flicker", "L3")["met"]
    assert statistic(told, "unbalance", "total")["high"] == 0.5
    f = statistic(told, "frequency", "total", "99.5 %")
    assert f["within"] == pytest.approx(358 / 360) and f["met"] is False and f["covered"] == pytest.approx(360 / 8_640)
    assert statistic(told, "frequency", "total", "always")["met"] is True
    assert told[0]["met"] is False and told[0]["simulated"]


def test_events_are_counted_once_by_voltage_and_duration(told):
    counts = {(one["kind"], one["voltage"]): one["counts"] for one in told[0]["events"]}
    assert counts["dip, interruption", "70 to 80"] == [1, 0, 0, 0, 0, 0]
    assert counts["dip, interruption", "0 to 5"] == [0, 0, 0, 1, 0, 0]  # the dip around the interruption is not another
    assert counts["swell", "110 to 120"] == [0, 1, 0, 0, 0, 0] and sum(map(sum, counts.values())) == 3


def test_the_page_is_whole_and_names_what_is_not_met(told):
    text = told[1]
    assert "of EN 50160 not met" in text and "NOT MET" in text and "simulated" in text
    assert text.count('role="img"') >= 3


def test_bad_input_is_one_line(database, tmp_path):
    for done, said in (
        (report(database, "--device", "cell9"), "--device 'cell9': no 10 min values; the database has those of cell1"),
        (report(database, "--from", "yesterday"), "--from 'yesterday': expected a time like"),
        (report(database, "--from", "2025-06-16", "--to", "2025-06-15"), "--to '2025-06-15': expected a time up to"),
        (report(database, "--from", "2024-01-01"), "no 10 min values of power quality from 2024-01-01"),
        (report(database, "--out", tmp_path / "week.pdf"), "a report ends in .html"),
        (report(tmp_path / "none.sqlite"), "no such file"),
    ):
        assert done.returncode == 2 and said in done.stderr and done.stderr.count("\n") == 1, done.stderr
