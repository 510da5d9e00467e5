"""SQL for TimescaleDB, without it: PostgreSQL's parser, and functions with the signatures that it documents.

Signatures: API reference of TimescaleDB, and sql/ddl_api.sql and sql/policy_api.sql of its sources. What its storage
does with the rows, `python -m tools.studies.timescale` shows by hand.
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest
import sqlalchemy as sa

from acqd.storage.database import engine_for, open_database
from acqd.storage.schema import power
from acqd.storage.writer import Writer
from tests.storage.rows import count, message, row

PAGE = Path(__file__).parents[2] / "docs" / "scaling.md"
OPTIONS = {
    "compress": r"", "compress_segmentby": r"\w+(, \w+)*", "continuous": r"",
    "compress_orderby": r"\w+( ASC| DESC)?( NULLS (FIRST|LAST))?(, \w+( ASC| DESC)?( NULLS (FIRST|LAST))?)*",
}  # fmt: skip
"""What ALTER TABLE and CREATE MATERIALIZED VIEW take after `timescaledb.`, and how their values are written."""
FUNCTIONS = """
CREATE TABLE called (name text, relation regclass, what text);
CREATE FUNCTION create_hypertable(relation regclass, time_column_name name, partitioning_column name = NULL,
    number_partitions integer = NULL, associated_schema_name name = NULL, associated_table_prefix name = NULL,
    chunk_time_interval anyelement = NULL::bigint, create_default_indexes boolean = TRUE,
    if_not_exists boolean = FALSE, partitioning_func regproc = NULL, migrate_data boolean = FALSE,
    chunk_target_size text = NULL, chunk_sizing_func regproc = NULL, time_partitioning_func regproc = NULL)
    RETURNS integer LANGUAGE sql AS $$ INSERT INTO called VALUES
    ('create_hypertable', relation, time_column_name || ' ' || chunk_time_interval::text) RETURNING 1 $$;
CREATE FUNCTION time_bucket(bucket_width interval, ts timestamptz)
    RETURNS timestamptz LANGUAGE sql IMMUTABLE AS $$ SELECT date_bin(bucket_width, ts, 'epoch') $$;
CREATE FUNCTION add_compression_policy(hypertable regclass, compress_after interval = NULL, if_not_exists bool = false,
    schedule_interval interval = NULL, initial_start timestamptz = NULL, timezone text = NULL,
    compress_created_before interval = NULL)
    RETURNS integer LANGUAGE sql AS $$ INSERT INTO called VALUES
    ('add_compression_policy', hypertable, compress_after::text) RETURNING 1 $$;
CREATE FUNCTION add_continuous_aggregate_policy(continuous_aggregate regclass, start_offset interval,
    end_offset interval, schedule_interval interval, if_not_exists bool = false,
    initial_start timestamptz = NULL, timezone text = NULL)
    RETURNS integer LANGUAGE sql AS $$ INSERT INTO called VALUES
    ('add_continuous_aggregate_policy', continuous_aggregate, end_offset::text) RETURNING 1 $$;
SET allow_system_table_mods = on;
INSERT INTO pg_extension (oid, extname, extowner, extnamespace, extrelocatable, extversion)
    VALUES (99999, 'timescaledb', 10, 2200, false, '2.23.0');
"""


@pytest.fixture
def with_extension(postgres):
    """URL of a database that says it has the extension, and writes down what its functions are called with."""
    engine = engine_for(postgres)
    with engine.begin() as connection:
        for statement in FUNCTIONS.split(";\n"):
            connection.exec_driver_sql(statement)
    engine.dispose()
    return postgres


def _statements():
    blocks = re.findall(r"```sql\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    every = [statement.strip() for block in blocks for statement in block.split(";\n")]
    return [one.rstrip(";") for one in every if re.search("timescaledb|_policy", one)]


def _called(connection):
    return [tuple(one) for one in connection.exec_driver_sql("SELECT name, relation::text, what FROM called")]


def test_the_key_of_the_hypertable_has_its_time_and_rows_stay_unique(with_extension):
    engine = open_database(with_extension)
    with engine.connect() as connection:
        assert _called(connection) == [("create_hypertable", "power", "time 168:00:00")]
        assert "time" in sa.inspect(connection).get_pk_constraint("power")["constrained_columns"]
    for _ in range(2):
        Writer(engine).write([message(row(k)) for k in range(3)])
    assert count(engine) == 3


def test_the_statements_of_the_page_are_those_that_the_extension_documents(with_extension):
    engine = open_database(with_extension)
    statements = _statements()
    assert len(statements) == 4
    for statement in statements:
        with engine.begin() as connection:
            connection.exec_driver_sql(_without_options(connection, statement))
    with engine.connect() as connection:
        assert sorted(_called(connection)) == [
            ("add_compression_policy", "power", "8 days"),
            ("add_continuous_aggregate_policy", "power_hourly", "01:00:00"),
            ("create_hypertable", "power", "time 168:00:00"),
        ]


def _without_options(connection, statement):
    """Check the options that the extension adds, and leave them out: PostgreSQL parses them, and knows them not."""
    options = dict(re.findall(r"timescaledb\.(\w+)(?: = '([^']*)')?", statement))
    if not options:
        return statement
    for name, value in options.items():
        assert re.fullmatch(OPTIONS[name], value), f"{name} = {value!r}"
    named = {word for value in options.values() for word in re.findall(r"[a-z]+", value)}
    assert named <= {column.name for column in power.columns}
    unknown = 'unrecognized parameter namespace "timescaledb"'
    with pytest.raises(sa.exc.DBAPIError, match=unknown), connection.begin_nested():
        connection.exec_driver_sql(statement)
    if statement.startswith("ALTER"):
        return "SELECT 1"
    return re.sub(r" WITH \(timescaledb\.\w+\)", "", statement)
