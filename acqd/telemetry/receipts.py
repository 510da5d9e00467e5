"""Receipts: what the sink has stored, by ranges of `seq` for every device, channel and boot.

One message holds the receipts of one device; its topic belongs to the device, so that a daemon gets only what
concerns it. The sink also announces itself (retained, last will `offline`): rows of a time without a sink are
then sent again at once.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Mapping
from typing import Annotated

import msgspec
from msgspec import UNSET, Meta, UnsetType

from acqd.telemetry.ranges import Ranges
from acqd.telemetry.spool import Stream
from acqd.telemetry.topics import receipt
from acqd.timestamps import rfc3339

_RANGES_PER_MESSAGE = 2_000
_LARGEST = 256 << 10
"""Bytes of a receipt at most: that many ranges, and the names of their streams."""
_Seq = Annotated[int, Meta(ge=0, le=2**63 - 1)]


class StoredRows(msgspec.Struct):
    """Rows of one channel and boot: first and last `seq` of each range."""

    channel: str
    boot: str
    seq: Annotated[list[tuple[_Seq, _Seq]], Meta(max_length=_RANGES_PER_MESSAGE)]


class LastRow(msgspec.Struct, frozen=True):
    """The newest stored row of a channel."""

    channel: str
    boot: str
    seq: _Seq
    W: float
    """kWh: import minus export."""


class Commits(msgspec.Struct, frozen=True):
    """How far a sink's database is, and by whose commits it came there (ADR 97)."""

    database: str
    """Its identity, which a copy has, too."""
    run: str
    """A name that the sink has drawn when it was started, or when it found that others had written under its name."""
    after: str
    """The run that made the commit before; empty: none, or not named, or the sink knows that commits are missing."""
    begun: _Seq
    """Number of the commit before, the last one that the sink knew of; 0: none."""
    now: _Seq
    """Number of the last commit."""


class Receipt(msgspec.Struct):
    """One message on the receipt topic of a device."""

    sink: str
    stored: Annotated[list[StoredRows], Meta(max_length=_RANGES_PER_MESSAGE)]
    schema: int = 1
    last: list[LastRow] | UnsetType = UNSET
    """The answer to a question for the last rows; empty: none is stored."""
    boot: str | UnsetType = UNSET
    """The boot of that question; sinks of earlier versions do not say it."""
    time: str | UnsetType = UNSET
    """When it was sent, by the sink's clock (RFC 3339)."""
    commits: Commits | UnsetType = UNSET
    """Of this sink, with that of these rows."""


_decoder = msgspec.json.Decoder(Receipt)


def receipts(sink: str, stored: Mapping[Stream, Ranges], commits: Commits | None = None) -> Iterator[tuple[str, bytes]]:
    """Topic and payload of the messages for these rows."""
    by_device: dict[str, list[StoredRows]] = {}
    for stream, rows in stored.items():
        pairs = list(rows)
        for start in range(0, len(pairs), _RANGES_PER_MESSAGE):
            entry = StoredRows(stream.channel, stream.boot, pairs[start : start + _RANGES_PER_MESSAGE])
            by_device.setdefault(stream.device, []).append(entry)
    for device, entries in by_device.items():
        for group in _groups(entries):
            message = Receipt(
                sink, group, time=rfc3339(time.time_ns(), 3), commits=UNSET if commits is None else commits
            )
            yield receipt(device), msgspec.json.encode(message)


def answer(sink: str, device: str, boot: str, last: list[LastRow]) -> tuple[str, bytes]:
    """Topic and payload of the answer to a question for the last rows of a boot."""
    return receipt(device), msgspec.json.encode(Receipt(sink, [], last=last, boot=boot))


def parse_receipt(payload: bytes) -> Receipt:
    """Raises ValueError, also for more than a sink says in one message: the daemon looks through its spool for each."""
    if len(payload) > _LARGEST:
        raise ValueError(f"{len(payload)} bytes are more than any sink sends")
    try:
        message = _decoder.decode(payload)
    except (msgspec.DecodeError, RecursionError) as error:
        raise ValueError(str(error)) from None
    if sum(len(entry.seq) for entry in message.stored) > _RANGES_PER_MESSAGE:
        raise ValueError(f"more than {_RANGES_PER_MESSAGE} ranges")
    return message


def ranges_of(device: str, message: Receipt) -> list[tuple[Stream, int, int]]:
    """Stream, first and last `seq` of every range."""
    return [
        (Stream(device, entry.channel, entry.boot), first, last)
        for entry in message.stored
        for first, last in entry.seq
        if first <= last
    ]


class Announcement(msgspec.Struct):
    """What a sink says on its status topic, which the broker keeps."""

    recall: bool = False
    """Its database is new or in an earlier state: rows that had a receipt are missing. Sinks of earlier
    versions say no more."""
    recalled: str = ""
    """Names the last time that this was so, for daemons that were away then."""


_announcements = msgspec.json.Decoder(Announcement)


def announcement(payload: bytes) -> Announcement:
    """What a sink says; nothing where it cannot be read."""
    try:
        return _announcements.decode(payload)
    except (msgspec.DecodeError, RecursionError):
        return Announcement()


def _groups(entries: Iterable[StoredRows]) -> Iterator[list[StoredRows]]:
    """Entries in groups that fit into one message each."""
    group: list[StoredRows] = []
    ranges = 0
    for entry in entries:
        if group and ranges + len(entry.seq) > _RANGES_PER_MESSAGE:
            yield group
            group, ranges = [], 0
        group.append(entry)
        ranges += len(entry.seq)
    if group:
        yield group
