"""The row: one window of one channel, as MQTT payload, JSON line and SQL columns alike."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from datetime import datetime
from typing import Annotated, Any, Literal

import msgspec
import numpy as np
from msgspec import Meta

from acqd.metering import WindowBatch
from acqd.metering.power import power_factor, total
from acqd.timestamps import filetime, rfc3339

SCHEMA = 1
Channel = Literal["L1", "L2", "L3", "total"]
CHANNELS: tuple[Channel, ...] = ("L1", "L2", "L3", "total")
_INT64 = 2**63 - 1
_REASON = 300
"""Characters of the reason why a payload is no row."""
_Quantity = Annotated[float, Meta(ge=-1e15, le=1e15)] | None
_Quantities = tuple[_Quantity, _Quantity, _Quantity, _Quantity, _Quantity, _Quantity, _Quantity]  # Vrms .. W
_Name = Annotated[str, Meta(min_length=1, max_length=64)]
_Integer = Annotated[int, Meta(ge=0, le=_INT64)]


@dataclass(slots=True)
class PowerRow:
    """Field order is column order. None where a quantity does not exist in this window."""

    device: _Name
    channel: Channel
    boot: _Name
    """One daemon start."""
    seq: _Integer
    """Window number since that start."""
    time: str
    """RFC 3339 UTC of the window's first sample."""
    filetime: _Integer
    """The same in NTFS FILETIME: 100 ns since 1601-01-01 UTC."""
    Vrms: _Quantity
    """V."""
    Irms: _Quantity
    """A."""
    P: _Quantity
    """W."""
    S: _Quantity
    """VA."""
    PF: _Quantity
    f: _Quantity
    """Hz."""
    W: _Quantity
    """kWh since the register began: import minus export."""
    flags: list[_Name]
    schema: Annotated[int, Meta(ge=SCHEMA, le=SCHEMA)] = SCHEMA

    def to_json(self) -> bytes:
        """The MQTT payload, without a line end."""
        return _encoder.encode(self)


_decoder = msgspec.json.Decoder(PowerRow)
_encoder = msgspec.json.Encoder()


def json_lines(rows: Iterable[PowerRow]) -> bytes:
    """The rows as JSON lines, encoded together: a fifth of the time of one by one."""
    return _encoder.encode_lines(rows)


def parse_row(payload: bytes) -> PowerRow:
    """The row in a payload. Raises ValueError that says which field is wrong and why."""
    if b"\\u0000" in payload:
        raise ValueError("text holds a NUL character, which no database column takes")
    try:
        row = _decoder.decode(payload)
    except (msgspec.DecodeError, ValueError, RecursionError) as error:
        raise ValueError(str(error)[:_REASON]) from None  # it quotes the payload
    try:
        zoned = datetime.fromisoformat(row.time).tzinfo is not None
    except ValueError:
        zoned = False
    if not zoned:
        raise ValueError(f"time {row.time!r:.40} is not RFC 3339 with a time zone")
    return row


def rows_of(batch: WindowBatch, device: str, boot: str) -> Iterator[PowerRow]:
    """Rows window by window: L1, L2, L3 and, with more than one phase, total."""
    phases, windows = batch.P.shape
    apparent, energy = batch.S, batch.W
    columns = [batch.Vrms, batch.Irms, batch.P, apparent, power_factor(batch.P, apparent)]
    columns += [np.broadcast_to(batch.f, apparent.shape), energy]
    per_channel = [_listed(columns, phase) for phase in range(phases)]
    flags = [[sorted(named) for named in row] for row in batch.flags]
    names = list(CHANNELS[:phases])
    if phases > 1:
        sums = total(batch.Vrms, batch.Irms, batch.P)
        alike = [sums.Vrms, sums.Irms, sums.P, sums.S, power_factor(sums.P, sums.S), batch.f, energy.sum(axis=0)]
        per_channel.append(_listed([column[None] for column in alike], 0))
        flags.append([_total_flags([batch.flags[phase][k] for phase in range(phases)]) for k in range(windows)])
        names.append("total")
    for k, (seq, utc_ns) in enumerate(zip(batch.seq.tolist(), batch.utc_ns.tolist(), strict=True)):
        stamp, ticks = rfc3339(utc_ns), filetime(utc_ns)
        for name, values, named in zip(names, per_channel, flags, strict=True):
            Vrms, Irms, P, S, PF, f, W = values[k]
            yield PowerRow(device, name, boot, seq, stamp, ticks, Vrms, Irms, P, S, PF, f, W, named[k])


def _listed(columns: list[np.ndarray], phase: int) -> list[_Quantities]:
    """[windows][quantities] Python numbers, None for NaN."""
    table = np.array([column[phase] for column in columns]).T
    rows: list[Any] = table.tolist()
    if np.isnan(table).any():
        rows = [[None if value != value else value for value in row] for row in rows]
    return rows


def _total_flags(phases: list[set[str]]) -> list[str]:
    """What holds for any phase holds for the total; mains are gone only when all phases are."""
    named = set().union(*phases)
    if not all("no_mains" in flags for flags in phases):
        named.discard("no_mains")
    return sorted(named)
