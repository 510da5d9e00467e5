"""The row: one window of one channel, as MQTT payload, JSON line and SQL columns alike."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from datetime import datetime
from operator import attrgetter, mul, sub
from typing import Annotated, Literal, Protocol, TypeVar

import msgspec
from msgspec import Meta

from acqd.metering import WindowBatch
from acqd.metering.power import effective, power_factor
from acqd.metering.window import windows_of
from acqd.timestamps import filetime, rfc3339

SCHEMA = 1
Channel = Literal["L1", "L2", "L3", "total"]
CHANNELS: tuple[Channel, ...] = ("L1", "L2", "L3", "total")
_CHANNELS_OF: dict[int, tuple[Channel, ...]] = {1: ("L1",), 2: ("L1", "L2", "total"), 3: CHANNELS}
"""By the number of phases."""
_INT64 = 2**63 - 1
_REASON = 300
"""Characters of the reason why a payload is no row."""
Number = Annotated[float, Meta(ge=-1e15, le=1e15)] | None
Name = Annotated[str, Meta(min_length=1, max_length=64)]
Integer = Annotated[int, Meta(ge=0, le=_INT64)]


class PowerRow(msgspec.Struct, gc=False):
    """Field order is column order. None where a quantity does not exist in this window."""

    device: Name
    channel: Channel
    boot: Name
    """One daemon start."""
    seq: Integer
    """Window number since that start."""
    time: str
    """RFC 3339 UTC of the window's first sample."""
    filetime: Integer
    """The same in NTFS FILETIME: 100 ns since 1601-01-01 UTC."""
    Vrms: Number
    """V."""
    Irms: Number
    """A."""
    P: Number
    """W."""
    S: Number
    """VA."""
    PF: Number
    f: Number
    """Hz."""
    W: Number
    """kWh since the register began: import minus export."""
    flags: list[Name]
    schema: Annotated[int, Meta(ge=SCHEMA, le=SCHEMA)] = SCHEMA

    def to_json(self) -> bytes:
        """The MQTT payload, without a line end."""
        return _encoder.encode(self)


_NUL = re.compile(rb"\\u0000")  # faster than `in`, but slower than `in` for one character
_time = attrgetter("time")
_decoder = msgspec.json.Decoder(PowerRow)
_encoder = msgspec.json.Encoder()


def json_lines(rows: Iterable[PowerRow]) -> bytes:
    """The rows as JSON lines, encoded together: a fifth of the time of one by one."""
    return _encoder.encode_lines(rows)


class _Timed(Protocol):
    time: str


_Row = TypeVar("_Row", bound=_Timed)


def parse_row(payload: bytes) -> PowerRow:
    """The row in a payload. Raises ValueError that says which field is wrong and why."""
    return decoded(_decoder, payload)


def parse_each(payloads: Sequence[bytes]) -> list[PowerRow | ValueError]:
    """The row in each payload, or the error that `parse_row` raises.

    Half of the time of one by one: what all have in common is checked once.
    """
    together = b" ".join(payloads)
    parse = parse_row if b"\\" in together and _NUL.search(together) else _decoder.decode
    found: list[PowerRow | ValueError] = []
    failed = False
    todo = iter(payloads)
    while len(found) < len(payloads):
        try:
            found.extend(map(parse, todo))  # keeps the rows before one that raises
        except (msgspec.DecodeError, ValueError, RecursionError) as error:
            found.append(ValueError(str(error)[:_REASON]))  # it quotes the payload
            failed = True
    rows = [row for row in found if isinstance(row, PowerRow)] if failed else found
    times = set(map(_time, rows))  # the channels of a window have the same
    wrong = {time: reason for time in times if (reason := _wrong_zone(time)) is not None}
    return [wrong.get(row.time, row) if isinstance(row, PowerRow) else row for row in found] if wrong else found


def decoded(decoder: msgspec.json.Decoder[_Row], payload: bytes) -> _Row:
    """What `decoder` makes of a payload with a time. Raises ValueError that says which field is wrong and why."""
    if _NUL.search(payload):
        raise ValueError("text holds a NUL character, which no database column takes")
    try:
        row = decoder.decode(payload)
    except (msgspec.DecodeError, ValueError, RecursionError) as error:
        raise ValueError(str(error)[:_REASON]) from None  # it quotes the payload
    if (wrong := _wrong_zone(row.time)) is not None:
        raise wrong
    return row


def _wrong_zone(time: str) -> ValueError | None:
    """What is wrong with a time, if anything."""
    try:
        zoned = datetime.fromisoformat(time).tzinfo is not None
    except ValueError:
        zoned = False
    return None if zoned else ValueError(f"time {time!r:.40} is not RFC 3339 with a time zone")


def rows_of(batch: WindowBatch, device: str, boot: str) -> Iterator[PowerRow]:
    """Rows window by window: L1, L2, L3 and, with more than one phase, total.

    Vrms and Irms of the total are effective values of the system; P, S (arithmetic) and W are sums of the phases.
    """
    for one in windows_of(batch):
        seq, f, numbers, readings = one.seq, one.f, one.quantities, one.readings
        count = len(readings) // 2
        stamp, ticks = rfc3339(one.utc_ns), filetime(one.utc_ns)
        V, A, watts = numbers[:count], numbers[count : 2 * count], numbers[2 * count : 3 * count]
        VA, kWh = [*map(mul, V, A)], [*map(sub, readings[:count], readings[count:])]
        flags = [[] for _ in range(count)] if one.flags is None else [sorted(names) for (names,) in one.flags]
        if count > 1:
            flags.append([] if one.flags is None else _total_flags([names for (names,) in one.flags]))
            V, A = [*V, effective(V)], [*A, effective(A)]
            watts, VA, kWh = [*watts, sum(watts)], [*VA, sum(VA)], [*kWh, sum(kWh)]
        f_known = f if f == f else None  # None for NaN; a function for this would take a sixth of the time of all
        columns = (_CHANNELS_OF[count], V, A, watts, VA, kWh, flags)
        for channel, V_k, A_k, P_k, S_k, W_k, names in zip(*columns, strict=True):
            PF = power_factor(P_k, S_k)
            yield PowerRow(
                device, channel, boot, seq, stamp, ticks, V_k if V_k == V_k else None, A_k if A_k == A_k else None,
                P_k if P_k == P_k else None, S_k if S_k == S_k else None, PF if PF == PF else None, f_known,
                W_k if W_k == W_k else None, names,
            )  # fmt: skip


def _total_flags(phases: list[set[str]]) -> list[str]:
    """What holds for any phase holds for the total; mains are gone only when all phases are."""
    named = set().union(*phases)
    if not all("no_mains" in flags for flags in phases):
        named.discard("no_mains")
    return sorted(named)
