"""Power rows from SQL, CSV, JSON lines or Parquet as one sorted stream that need not fit into memory."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np
import orjson
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet
import sqlalchemy as sa
from numpy.typing import NDArray

from acqd.arrays import Floats
from acqd.errors import InputError, UserError
from acqd.storage.database import open_database
from acqd.storage.schema import power
from acqd.timestamps import Nanoseconds, filetime, parse_times

Measured = Literal["mains", "derived", "simulated"]
"""What P is: a meter's, computed from other measurements (currents), or a simulation's."""
_LABELS: tuple[Measured, ...] = ("simulated", "derived")  # flags of rows that say so
_CHUNK = 100_000
_BAD_FLAGS = frozenset({"gap", "overrange", "no_mains", "invalid", "stale", "test"})
"""Rows with these have no P that can be trusted."""
_ROW = np.dtype([("time", np.int64), ("P", np.float64), ("Vrms", np.float64)])


@dataclass(frozen=True, slots=True)
class PowerStream:
    """Rows of one channel of one device, rising in time, each time once."""

    time_ns: Nanoseconds
    """[N] UTC of each window's first sample."""
    P: Floats
    """[N] W; NaN where the row's flags forbid it."""
    Vrms: Floats
    """[N] V; NaN where unknown."""
    window_ns: int
    """Length of a window: the median step."""
    dropped: int
    """Duplicates left out."""
    measured: Measured
    origin: str
    """Where it came from."""

    def part(self, begin_ns: int, end_ns: int) -> slice:
        """Rows whose windows begin from `begin_ns` up to, not including, `end_ns`."""
        first, last = np.searchsorted(self.time_ns, (begin_ns, end_ns))
        return slice(int(first), int(last))


@dataclass(frozen=True, slots=True)
class _Rows:
    time_ns: Nanoseconds
    P: Floats
    Vrms: Floats
    labels: frozenset[str]
    """Flags that occur."""


def open_power(
    origin: str,
    device: str | None,
    channel: str | None,
    between_ns: tuple[int, int] | None = None,
    engine: sa.Engine | None = None,
) -> PowerStream:
    """Rows of `device` and `channel` (None: the only device; total, else L1) from a URL or file. Raises UserError.

    They are spooled into a temporary file that is mapped, so that a stream may be larger than memory. `between_ns`
    (UTC) asks a database for a part only; `engine` is that database, if it is open already.
    """
    path = Path(origin)
    if "://" in origin or path.suffix in (".sqlite", ".db", ".sqlite3"):
        pieces = _from_sql(origin, device, channel, between_ns, engine)
    elif path.suffix == ".parquet":
        pieces = _from_tables(path, lambda: _parquet(_existing(path)), device, channel)
    elif path.suffix in (".jsonl", ".json", ".ndjson"):
        pieces = _from_tables(path, lambda: _json_lines(_existing(path)), device, channel)
    elif path.suffix in (".csv", ".txt"):
        pieces = _from_tables(path, lambda: _csv(_existing(path)), device, channel)
    else:
        raise UserError(f"power {origin}: expected an SQL URL, or a .sqlite, .csv, .jsonl or .parquet file")
    return _spool(origin, pieces)


def _spool(origin: str, pieces: Iterator[_Rows]) -> PowerStream:
    labels: set[str] = set()
    with tempfile.TemporaryFile(prefix="acqd-power-") as file:
        for piece in pieces:
            rows = np.empty(len(piece.time_ns), dtype=_ROW)
            rows["time"], rows["P"], rows["Vrms"] = piece.time_ns, piece.P, piece.Vrms
            file.write(rows.tobytes())
            labels |= piece.labels
        file.flush()
        if file.tell() < 3 * _ROW.itemsize:
            raise UserError(f"power {origin}: fewer than three rows of that device and channel")
        mapped: NDArray[np.void] = np.memmap(file, dtype=_ROW, mode="r")
    time_ns = mapped["time"]
    dropped = 0
    if (np.diff(time_ns) <= 0).any():
        _, order = np.unique(time_ns, return_index=True)  # sorts; of equal times keeps the first
        dropped = len(time_ns) - len(order)
        mapped = mapped[order]
        time_ns = mapped["time"]
    window_ns = round(float(np.median(np.diff(time_ns[:100_000]))) / 1000) * 1000  # clocks of files: to the us
    known = mapped["P"][np.isfinite(mapped["P"])]
    if len(known) < 3 or np.ptp(known) == 0.0:
        raise UserError(f"power {origin}: P is constant or missing; is this the robot's channel?")
    measured: Measured = next((label for label in _LABELS if label in labels), "mains")
    return PowerStream(time_ns, mapped["P"], mapped["Vrms"], window_ns, dropped, measured, origin)


def _from_sql(
    origin: str,
    device: str | None,
    channel: str | None,
    between_ns: tuple[int, int] | None,
    engine: sa.Engine | None,
) -> Iterator[_Rows]:
    if Path(origin).is_file() and Path(origin).stat().st_size == 0:
        raise InputError(origin, "is empty; expected a database with a table of power rows")
    engine = engine or open_database(origin, create=False)
    span = [] if between_ns is None else [power.c.filetime.between(filetime(between_ns[0]), filetime(between_ns[1]))]
    with engine.connect() as connection:
        found = connection.execute(sa.select(power.c.device, power.c.channel).where(*span).distinct()).all()
        device, channel = _choose(origin, {(row[0], row[1]) for row in found}, device, channel)
        # flags as text: a database of a day holds a handful of different ones, parsed once each
        columns = (power.c.filetime, power.c.P, power.c.Vrms, sa.cast(power.c.flags, sa.Text))
        query = sa.select(*columns).where(power.c.device == device, power.c.channel == channel)
        # the key: no sorting in the database
        query = query.order_by(power.c.boot, power.c.seq) if between_ns is None else query.where(*span)
        result = connection.execution_options(stream_results=True).execute(query)
        for rows in result.partitions(_CHUNK):
            stamps, P, Vrms, flags = zip(*rows, strict=True)
            known = {text: orjson.loads(text) for text in set(flags)}
            named = [known[text] for text in flags]
            yield _rows(parse_times(Path(origin), "filetime", stamps), P, Vrms, named)


def _rows(time_ns: Nanoseconds, P: object, Vrms: object, flags: object) -> _Rows:
    values, volts = np.array(P, dtype=np.float64), np.array(Vrms, dtype=np.float64)
    named = [frozenset(each or ()) for each in flags]  # type: ignore[attr-defined]
    values[[bool(each & _BAD_FLAGS) for each in named]] = np.nan
    return _Rows(time_ns, values, volts, frozenset().union(*named))


def _choose(origin: str, found: set[tuple[str, str]], device: str | None, channel: str | None) -> tuple[str, str]:
    devices = sorted({name for name, _ in found})
    if not devices:
        raise UserError(f"power {origin}: holds no rows")
    if device is None and len(devices) > 1:
        raise UserError(f"power {origin}: holds several devices; choose one with --device: {', '.join(devices)}")
    device = device or devices[0]
    channels = sorted(name for owner, name in found if owner == device)
    if not channels:
        raise UserError(f"power {origin}: has no device {device!r}; it has {', '.join(devices)}")
    channel = channel or ("total" if "total" in channels else channels[0])
    if channel not in channels:
        raise UserError(f"power {origin}: {device} has no channel {channel!r}; it has {', '.join(channels)}")
    return device, channel


def _from_tables(
    path: Path, read: Callable[[], Iterator[pa.RecordBatch]], device: str | None, channel: str | None
) -> Iterator[_Rows]:
    """Batches with at least a time column and P; device, channel, Vrms and flags where they are."""
    seen: set[tuple[str, str]] = set()
    for table in read():  # once for what there is to choose from, once for the rows
        seen |= set(zip(*_owners(table), strict=True))
    wanted = _choose(str(path), seen, device, channel)
    for table in read():
        names = table.schema.names
        clock = next((name for name in ("filetime", "time") if name in names), None)
        if clock is None or "P" not in names:
            raise InputError(path, f"needs the columns time (or filetime) and P; it has {', '.join(names[:8])}")
        data = table.to_pydict()
        keep = [k for k, pair in enumerate(zip(*_owners(table), strict=True)) if pair == wanted]
        if not keep:
            continue
        flags = [_flag_names(cell) for cell in data["flags"]] if "flags" in data else [()] * len(table)
        volts = data.get("Vrms", [None] * len(table))
        stamps = parse_times(path, clock, [_timestamp(data[clock][k]) for k in keep])
        try:
            yield _rows(
                stamps,
                [_number(data["P"][k]) for k in keep],
                [_number(volts[k]) for k in keep],
                [flags[k] for k in keep],
            )
        except ValueError as error:
            raise InputError(path, f"column P or Vrms: {error}") from None


def _owners(table: pa.RecordBatch) -> tuple[list[str], list[str]]:
    """Device and channel of each row; empty where a file has no such column."""
    names = table.schema.names
    device, channel = (
        table.column(name).to_pylist() if name in names else [""] * len(table) for name in ("device", "channel")
    )
    return device, channel


def _timestamp(cell: object) -> object:
    return cell.isoformat() if hasattr(cell, "isoformat") else cell


def _number(cell: object) -> float:
    return float("nan") if cell is None or cell == "" else float(cell)  # type: ignore[arg-type]


def _flag_names(cell: object) -> tuple[str, ...]:
    if isinstance(cell, str):
        return tuple(re.findall(r"\w+", cell))  # a JSON list, or words
    return tuple(cell or ())  # type: ignore[arg-type]


def _existing(path: Path) -> Path:
    if not path.is_file():
        raise InputError(path, "no such file")
    return path


def _parquet(path: Path) -> Iterator[pa.RecordBatch]:
    try:
        yield from pyarrow.parquet.ParquetFile(path).iter_batches(_CHUNK)
    except (pa.ArrowInvalid, OSError) as error:
        raise InputError(path, f"is no Parquet file ({str(error).splitlines()[0]})") from None


def _csv(path: Path) -> Iterator[pa.RecordBatch]:
    try:
        yield from pyarrow.csv.open_csv(path)
    except pa.ArrowInvalid as error:
        raise InputError(path, str(error).splitlines()[0]) from None


def _json_lines(path: Path) -> Iterator[pa.RecordBatch]:
    rows: list[dict[str, object]] = []
    with path.open("rb") as file:
        for number, line in enumerate(file, start=1):
            try:
                row = orjson.loads(line)
            except orjson.JSONDecodeError as error:
                raise InputError(path, f"line {number} is no JSON ({error})") from None
            if not isinstance(row, dict):
                raise InputError(path, f"line {number} is no JSON object with time and P")
            rows.append(row)
            if len(rows) == _CHUNK:
                yield _batch(path, rows, number)
                rows = []
    if rows:
        yield _batch(path, rows, number)


def _batch(path: Path, rows: list[dict[str, object]], last: int) -> pa.RecordBatch:
    try:
        return pa.RecordBatch.from_pylist(rows)
    except (pa.ArrowInvalid, pa.ArrowTypeError) as error:
        reason = str(error).splitlines()[0]
        raise InputError(
            path, f"lines {last - len(rows) + 1} to {last}: a column changes its type ({reason})"
        ) from None
