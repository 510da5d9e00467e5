"""The arithmetic of a plan: proportional, monotone, never less than its parts."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acqd.daemon.config import Config
from acqd.errors import UserError
from acqd.planning.demand import Demand
from acqd.planning.measured import shipped
from acqd.planning.needs import KEEP_DAYS, KEEP_ROLLUPS_DAYS, SPOOL_GB, plan

MEASURED = shipped()
CELL, ALL, PCS, SERVERS = "largest cell", "all together", "measurement PCs", "brokers, sinks and databases"
M = {key: one.value for key, one in MEASURED.items()}
demands = st.builds(
    Demand,
    robots=st.integers(1, 5_000),
    channels=st.integers(1, 4),
    rows_per_second=st.floats(0.1, 25),
    quality=st.sampled_from(["off", "10/12", "150/180", "10min"]),
    archive_days=st.sampled_from([0.0, 1.0, 30.0]),
    days=st.one_of(st.none(), st.floats(1, 1_000)),
    cores=st.integers(1, 16),
    boxes=st.integers(1, 50),
    load=st.floats(0.3, 0.9),
)


def needs(demand):
    """Values by part and name."""
    return {(one.part, one.name): one.value for one in plan(demand, MEASURED).needs}


def test_units_of_one_robot():
    """A robot with 100 rows/s, by hand."""
    found = needs(Demand(1, days=10.0))
    assert found[ALL, "rows"] == 100
    assert found[ALL, "tables"] == pytest.approx(100 * 86_400 * M["row_table"] / 1e9)
    assert found[ALL, "network into the brokers"] == pytest.approx(100 * M["row_packet"] * 8 / 1e6)
    rolled = 4 * (1_440 * M["minute_table"] + 96 * M["quarter_table"]) / 1e9
    assert found[CELL, "tables, rolled up"] == pytest.approx(rolled)
    assert found[CELL, "disk of the database"] == pytest.approx(10 * found[ALL, "tables"] + 365 * rolled)
    assert found[PCS, "CPU of a PC"] == M["one_box_cpu"] and found[PCS, "memory of the daemon"] == M["one_box_memory"]
    assert found[PCS, "broker or database may be away for"] == pytest.approx(1e9 / (100 * M["spooled_row"]) / 3_600)
    assert all(found[SERVERS, name] == 1 for name in ("brokers", "sinks", "databases"))


def test_computers_follow_from_shares_of_a_core():
    found = needs(Demand(10_000))
    most = min(
        math.floor(50 / M["broker_cpu"] * M["rows_stored"] / 100),
        math.floor(4 * 3_600 / (8.64 * (2 * M["rollup_time"] + M["deletion_time"]))),
    )
    assert found[SERVERS, "robots of a cell at most"] == most
    assert found[SERVERS, "brokers"] == found[SERVERS, "databases"] == math.ceil(10_000 / most)
    assert found[PCS, "PCs"] == 1_250 and found[PCS, "boxes at a PC at most"] == 8
    assert found[PCS, "CPU of a PC"] == pytest.approx(M["eight_boxes_cpu"])


def test_power_quality_adds_rows_of_the_longer_intervals_too():
    rate = {name: needs(Demand(1, quality=name))[ALL, "rows"] - 100 for name in ("10/12", "150/180", "10min")}
    assert rate["10/12"] == pytest.approx(4 * (5 + 1 / 3 + 1 / 600 + 1 / 7_200) + 0.1)
    assert rate["150/180"] == pytest.approx(4 * (1 / 3 + 1 / 600 + 1 / 7_200) + 0.1)
    assert rate["10min"] == pytest.approx(4 * (1 / 600 + 1 / 7_200) + 0.1)


@settings(max_examples=25, deadline=None)
@given(demands, st.integers(1, 3_000))
def test_more_robots_never_need_less_and_the_whole_is_at_least_its_parts(demand, more):
    few, many = needs(demand), needs(replace(demand, robots=demand.robots + more))
    for key in few:
        if key[1] not in ("broker or database may be away for", "boxes that the cores would carry"):
            assert many[key] >= few[key] * (1 - 1e-12), key
    assert few[PCS, "PCs"] * few[PCS, "boxes at a PC at most"] >= demand.robots
    assert few[SERVERS, "brokers"] * few[SERVERS, "robots of a cell at most"] >= demand.robots
    assert few[SERVERS, "sinks"] >= few[SERVERS, "brokers"]
    assert few[CELL, "CPU of the broker"] <= 100 * demand.load * (1 + 1e-9)
    assert few[PCS, "CPU of a PC"] <= 100 * demand.load * demand.cores * (1 + 1e-9)
    assert few[CELL, "disk of the database"] >= few[CELL, "tables, rows"]
    assert few[CELL, "rows into the broker"] <= few[ALL, "rows"] * (1 + 1e-12)
    assert few[PCS, "disk of a PC"] >= SPOOL_GB
    assert all(math.isfinite(value) and value > 0 for value in few.values())


@settings(max_examples=15, deadline=None)
@given(st.integers(1, 400), st.floats(100, 1e5))
def test_the_retention_that_fits_fills_the_disk(robots, disk_gb):
    try:
        found = needs(Demand(robots, disk_gb=disk_gb))
    except UserError as error:
        assert "roll-ups" in str(error)
        return
    assert found[CELL, "disk of the database"] == pytest.approx(disk_gb)
    days = found[CELL, "retention that fits"]
    again = needs(Demand(robots, days=days * 0.999)) if 0.02 < days < 36_000 else found
    assert again[CELL, "disk of the database"] <= disk_gb * (1 + 1e-9)


def test_a_disk_and_a_retention_say_how_many_databases():
    free, tight = needs(Demand(200, days=90.0)), needs(Demand(200, days=90.0, disk_gb=3_000.0))
    assert tight[SERVERS, "databases"] > free[SERVERS, "databases"]
    assert tight[CELL, "disk of the database"] <= 3_000
    with pytest.raises(UserError, match="--disk 10: rows of one robot need"):
        needs(Demand(200, days=90.0, disk_gb=10.0))


def test_every_line_says_its_assumption_and_every_figure_its_command():
    found = plan(Demand(200, quality="10/12", archive_days=30.0, disk_gb=9_000.0), MEASURED)
    assert all(need.why for need in found.needs)
    assert {one.key for one in found.used} == set(MEASURED)  # a figure that no plan uses does not belong there
    assert all(one.command.startswith("python -m tools.") and one.when and one.machine for one in found.used)


def test_defaults_are_those_of_the_configuration():
    config = Config()
    kept = config.sink.retention()
    assert (kept.power_days, kept.rollup_1min_days) == (KEEP_DAYS, KEEP_ROLLUPS_DAYS)
    assert config.spool.max_mb == 1_000 * SPOOL_GB
