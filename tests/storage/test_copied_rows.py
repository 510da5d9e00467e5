"""Rows reach PostgreSQL by COPY as they are, whatever their texts hold."""

from __future__ import annotations

import sqlalchemy as sa
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from msgspec import structs

from acqd.storage import rows
from acqd.storage.database import open_database
from acqd.storage.schema import power
from tests.storage.rows import row

ODD = ['"', "\\", ",", "]", "[", "],[", '"],["', "\\.", "\n", "\r", "\t", "\\n", "null", "{", "é", "𝄞", " ", "\x7f"]
NAMES = st.lists(st.sampled_from(ODD) | st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=3)).map(
    lambda parts: "".join(parts)[:64] or "null"
)
NUMBERS = st.none() | st.floats(-1e15, 1e15)


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(st.tuples(NAMES, st.lists(NAMES, max_size=3), NUMBERS, st.booleans()), min_size=1, max_size=5))
def test_rows_with_any_text_come_back_from_postgresql(postgres, made):
    engine = open_database(postgres)
    sent = [
        row(k, device=name, boot=name, Vrms=None if empty else number, W=number, flags=flags)
        for k, (name, flags, number, empty) in enumerate(made)
    ]
    with engine.connect() as connection, connection.begin() as undone:
        assert rows.insert(connection, sent) == []
        assert rows.insert(connection, [*sent, structs.replace(sent[0], f=49.0)]) == [len(sent)]
        stored = connection.execute(sa.select(power).order_by(power.c.seq)).mappings().all()
        undone.rollback()
    engine.dispose()
    assert [{**one, "time": ""} for one in stored] == [{**structs.asdict(one), "time": ""} for one in sent]
