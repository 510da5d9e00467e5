"""The quality row: one aggregation interval of one channel, as MQTT payload, JSON line and SQL columns alike."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, fields
from math import isfinite
from typing import Annotated, Any, Literal

import msgspec
import numpy as np
from msgspec import Meta

from acqd.metering.power import power_factor
from acqd.metering.quality.values import KINDS, Kind, QualityValues
from acqd.telemetry.row import CHANNELS, SCHEMA, Channel, Integer, Name, Number, decoded
from acqd.timestamps import filetime, rfc3339

_List = Annotated[list[Number], Meta(max_length=64)] | None
_DECIMALS = 6
"""Of harmonics: uV and uA."""
_ROTATIONS: dict[float, Literal["L1-L2-L3", "L1-L3-L2"]] = {1.0: "L1-L2-L3", -1.0: "L1-L3-L2"}


@dataclass(slots=True)
class QualityRow:
    """Field order is column order. None where a quantity does not exist in this interval or for this channel."""

    device: Name
    channel: Channel
    boot: Name
    seq: Integer
    """Number of the value since the stream began, over all aggregations."""
    time: str
    """RFC 3339 UTC of the start of the interval."""
    filetime: Integer
    """The same in NTFS FILETIME."""
    aggregation: Kind
    duration: Number
    """s."""
    intervals: Integer
    """10/12-cycle intervals in it."""
    flags: list[Name]
    f: Number = None
    rocof: Number = None
    Vrms: Number = None
    Irms: Number = None
    P: Number = None
    S: Number = None
    PF: Number = None
    V1: Number = None
    I1: Number = None
    V1_angle: Number = None
    I1_angle: Number = None
    P1: Number = None
    Q1: Number = None
    S1: Number = None
    DPF: Number = None
    V_dc: Number = None
    I_dc: Number = None
    V_crest: Number = None
    I_crest: Number = None
    V_thds: Number = None
    I_thds: Number = None
    Se: Number = None
    PFe: Number = None
    V_12: Number = None
    V_23: Number = None
    V_31: Number = None
    V_pos: Number = None
    V_u2: Number = None
    V_u0: Number = None
    I_u2: Number = None
    I_u0: Number = None
    I_n_derived: Number = None
    V_ms: Number = None
    V_under: Number = None
    V_over: Number = None
    Pst: Number = None
    Plt: Number = None
    rotation: Literal["L1-L2-L3", "L1-L3-L2"] | None = None
    V_h: _List = None
    I_h: _List = None
    V_ih: _List = None
    I_ih: _List = None
    V_ig: _List = None
    I_ig: _List = None
    V_h_angle: _List = None
    I_h_angle: _List = None
    P_h: _List = None
    V_lines: _List = None
    I_lines: _List = None
    V_bands: _List = None
    I_bands: _List = None
    V_bands_1k: _List = None
    I_bands_1k: _List = None
    schema: Annotated[int, Meta(ge=SCHEMA, le=SCHEMA)] = SCHEMA

    def to_json(self) -> bytes:
        """The MQTT payload, without a line end."""
        return _encoder.encode(self)


_NAMES = [field.name for field in fields(QualityRow)]
LISTS = tuple(_NAMES[_NAMES.index("V_h") : _NAMES.index("schema")])
"""Fields that hold a list of numbers each."""
NUMBERS = [name for name in _NAMES[_NAMES.index("f") : _NAMES.index("V_h")] if name != "rotation"]
"""Fields that hold one number or None."""
_encoder = msgspec.json.Encoder()
_decoder = msgspec.json.Decoder(QualityRow)


def parse_quality(payload: bytes) -> QualityRow:
    """The row in a payload. Raises ValueError that says which field is wrong and why."""
    return decoded(_decoder, payload)


def quality_lines(rows: Iterable[QualityRow]) -> bytes:
    """The rows as JSON lines."""
    return _encoder.encode_lines(rows)


def quality_rows(values: QualityValues, device: str, boot: str, seq: int) -> Iterator[QualityRow]:
    """Rows of one value: L1, L2, L3 and, with more than one phase, total; of "10s" the total (or L1) only."""
    phases = len(values.phase_flags)
    columns: dict[str, list[Any]] = {
        name: _listed(value) if name in LISTS else _numbers(value.tolist()) for name, value in values.phase.items()
    }
    for k in range(phases if columns else 0):
        flags = values.flags | values.phase_flags[k]
        yield _row(values, device, CHANNELS[k], boot, seq, flags, _of_phase(columns, k))
    if values.system:
        everything = values.flags.union(*values.phase_flags)
        yield _row(values, device, "total", boot, seq, everything, _of_system(values))
    elif not values.phase:
        yield _row(values, device, "total" if phases > 1 else "L1", boot, seq, values.flags, {})


def _row(
    values: QualityValues, device: str, channel: Channel, boot: str, seq: int, flags: frozenset[str],
    quantities: dict[str, Any],
) -> QualityRow:  # fmt: skip
    return QualityRow(
        device, channel, boot, seq, rfc3339(values.utc_ns), filetime(values.utc_ns), values.kind, values.duration,
        values.intervals, sorted(flags), _known(values.f), _known(values.rocof), **quantities,
    )  # fmt: skip


def _of_phase(columns: dict[str, list[Any]], k: int) -> dict[str, Any]:
    row = {name: column[k] for name, column in columns.items()}
    if "P" in row:
        row["PF"] = _power_factor(row["P"], row["S"])
        row["DPF"] = _power_factor(row["P1"], math.hypot(row["P1"] or 0.0, row["Q1"] or 0.0))
    return row


def _of_system(values: QualityValues) -> dict[str, Any]:
    system = values.system
    row: dict[str, Any] = dict(zip(system, _numbers(system.values()), strict=True))
    row["rotation"] = _ROTATIONS.get(system.get("rotation", math.nan))
    row["PF"] = _power_factor(row["P"], row["S"])
    row["PFe"] = _power_factor(row["P"], row.get("Se"))
    row["DPF"] = _power_factor(row["P1"], math.hypot(row["P1"] or 0.0, row["Q1"] or 0.0))
    return row


def _power_factor(P: float | None, S: float | None) -> float | None:
    return None if P is None or S is None else _known(power_factor(P, S))


def _known(value: float) -> float | None:
    return value if isfinite(value) else None


def _numbers(values: Iterable[float]) -> list[float | None]:
    return [value if isfinite(value) else None for value in values]


def _listed(values: np.ndarray) -> list[list[float | None]]:
    """Lists of each phase, rounded."""
    rounded = np.round(values, _DECIMALS)
    lists = rounded.tolist()
    return lists if np.isfinite(rounded).all() else [*map(_numbers, lists)]


def from_kind(shortest: Kind) -> frozenset[Kind]:
    """The aggregations from `shortest` on, with the 10 s frequency."""
    return frozenset(KINDS[KINDS.index(shortest) :])
