"""Power rows of Parquet files, which pyarrow reads."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet

from acqd.dataset.arrow import UTC_NS
from acqd.dataset.power_cells import COLUMNS, Cells, clock_column
from acqd.dataset.power_source import BLOCK_ROWS
from acqd.errors import InputError
from acqd.parquet_size import check_size


def parquet_cells(path: Path, _notes: list[str]) -> Iterator[Cells]:
    """Blocks of a Parquet file. Raises InputError."""
    before = 0
    try:
        with pyarrow.parquet.ParquetFile(path) as parquet:
            check_size(path, parquet.metadata)
            clock = clock_column(path, parquet.schema_arrow.names)
            names = [name for name in COLUMNS if name in parquet.schema_arrow.names]
            for batch in parquet.iter_batches(BLOCK_ROWS, columns=names):
                yield _cells(batch, clock, before)
                before += len(batch)
    except (pa.ArrowInvalid, OSError) as error:
        raise InputError(path, f"is not a Parquet file ({str(error).splitlines()[0]})") from None


def _cells(batch: pa.RecordBatch, clock: str, before: int) -> Cells:
    times = batch.column(clock)
    with_zone = pa.types.is_timestamp(times.type) and times.type.tz is not None and not times.null_count
    time_ns = times.cast(UTC_NS).cast(pa.int64()).to_numpy() if with_zone else None
    columns = {name: batch.column(name).to_pylist() for name in batch.schema.names if name != clock or not with_zone}
    if not with_zone:
        columns[clock] = [cell.isoformat() if hasattr(cell, "isoformat") else cell for cell in columns[clock]]
    return Cells(clock, columns, len(batch), before, time_ns)
