"""Answers daemons that ask for their last stored rows after a power cut."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import sqlalchemy as sa

from acqd.storage import numbered_rows
from acqd.storage.received import Message
from acqd.storage.schema import power
from acqd.telemetry import topics
from acqd.telemetry.ask import parse_ask
from acqd.telemetry.receipts import LastRow
from acqd.telemetry.row import CHANNELS

_MOST = 500
"""Questions of one batch that are answered: a plant that comes back after a power cut, and no stranger's flood."""


class Asked(NamedTuple):
    """A question for the last rows of a boot."""

    device: str
    boot: str


def questions(messages: Iterable[Message]) -> list[Asked]:
    """Those among messages that this sink can answer, each once."""
    asked = []
    for message in messages:
        try:
            ask = parse_ask(message.payload)
        except ValueError:
            continue
        if ask.ask == "last_rows" and ask.boot:
            asked.append(Asked(topics.place(message.topic).device, ask.boot))
    return list(dict.fromkeys(asked))[:_MOST]


def last_rows(connection: sa.Connection, asked: Asked) -> list[LastRow]:
    """The newest row with a W of every channel, of the boot and its continuations (`boot.1`)."""
    if connection.dialect.name == "sqlite":
        return _numbered(connection, asked)
    c, found = power.c, []
    for channel in CHANNELS:
        query = (
            sa.select(c.boot, c.seq, c.W)
            .where(c.device == asked.device, c.channel == channel, c.W.is_not(None))
            .where(c.boot >= asked.boot, c.boot < f"{asked.boot}/")  # "/" follows "."
            .order_by(c.boot.desc(), c.seq.desc())
            .limit(1)
        )
        row = connection.execute(query).one_or_none()
        if row is not None and row.boot.partition(".")[0] == asked.boot:
            found.append(LastRow(channel, row.boot, int(row.seq), float(row.W)))
    return found


def _numbered(connection: sa.Connection, asked: Asked) -> list[LastRow]:
    found = {}
    for run, boot, base in numbered_rows.runs(connection, asked.device, asked.boot):
        if boot.partition(".")[0] != asked.boot:
            continue
        for channel in CHANNELS:
            if channel not in found and (row := numbered_rows.last_of_run(connection, run, channel)) is not None:
                found[channel] = LastRow(channel, boot, base + row[0], row[1])
    return list(found.values())
