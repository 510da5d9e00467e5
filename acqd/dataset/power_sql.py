"""Reads power rows from the sink's database."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import orjson
import sqlalchemy as sa

from acqd.dataset.power_source import BLOCK_ROWS, PowerRows, choose
from acqd.errors import InputError
from acqd.storage.database import open_database
from acqd.storage.schema import power
from acqd.storage.url import shown
from acqd.timestamps import filetime, parse_times


def read_database(
    origin: str,
    device: str | None,
    channel: str | None,
    between_ns: tuple[int, int] | None,
    engine: sa.Engine | None,
) -> Iterator[PowerRows]:
    """Rows of one device and channel, all or `between_ns` (UTC). Raises UserError, InputError."""
    if Path(origin).is_file() and Path(origin).stat().st_size == 0:
        raise InputError(origin, "is empty; expected a database with a table of power rows")
    engine = engine or open_database(origin, create=False)
    span = [] if between_ns is None else [power.c.filetime.between(filetime(between_ns[0]), filetime(between_ns[1]))]
    with engine.connect() as connection:
        pairs = connection.execute(sa.select(power.c.device, power.c.channel).where(*span).distinct()).all()
        device, channel = choose(shown(origin), {(row[0], row[1]) for row in pairs}, device, channel)
        # flags as text: the rows of a day have a handful of different lists, each of which is parsed once
        columns = (power.c.filetime, power.c.P, power.c.Vrms, sa.cast(power.c.flags, sa.Text))
        query = sa.select(*columns).where(power.c.device == device, power.c.channel == channel)
        # in the order of the key: the database need not sort
        if between_ns is not None:
            query = query.where(*span)
        elif connection.dialect.name == "postgresql":
            query = query.order_by(power.c.boot, power.c.seq)
        result = connection.execution_options(stream_results=True).execute(query)
        for rows in result.partitions(BLOCK_ROWS):
            stamps, P, Vrms, texts = zip(*rows, strict=True)
            parsed = {text: tuple(orjson.loads(text) or ()) for text in set(texts)}
            flags = [parsed[text] for text in texts]
            yield PowerRows.of(parse_times(Path(origin), "filetime", stamps), P, Vrms, flags)
