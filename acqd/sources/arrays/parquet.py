"""Tables in Parquet, and in Arrow's file and stream formats (Feather)."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from acqd.errors import InputError
from acqd.extras import require
from acqd.sources.arrays.channels import recording_of
from acqd.sources.arrays.contents import Contents, check_size, damaged
from acqd.sources.recording.channel import Recording
from acqd.sources.waveform import ChannelMap

_ADVICE = "write columns time, u1, i1 ..."


def load(path: Path, given: ChannelMap) -> Recording:
    """Columns of numbers; a column of time stamps, or of seconds, is the clock. Raises InputError.

    The unit is the one in the column's name, or the field's metadata `unit`.
    """
    require("Parquet and Arrow files", ["pyarrow"], "files")
    contents = Contents()
    try:
        if path.suffix.lower() == ".parquet":
            title = "Parquet"
            _parquet(path, contents)
        else:
            title = "Arrow"
            _arrow(path, contents)
    except InputError:
        raise
    except Exception as error:  # whatever a damaged file makes Arrow raise
        raise damaged(path, "Parquet or Arrow file", error) from None
    return recording_of(path, title, contents, given, _ADVICE)


def _parquet(path: Path, contents: Contents) -> None:
    from pyarrow import parquet

    with parquet.ParquetFile(path) as file:
        schema, rows = file.schema_arrow, file.metadata.num_rows
    check_size(path, 8 * rows * len(schema))

    def column(name: str) -> Any:
        with parquet.ParquetFile(path) as file:
            return file.read(columns=[name]).column(0)

    _add(contents, schema, rows, column)


def _arrow(path: Path, contents: Contents) -> None:
    import pyarrow
    from pyarrow import ipc

    def table() -> Any:
        with pyarrow.memory_map(str(path)) as source:
            try:
                return ipc.open_file(source).read_all()
            except pyarrow.ArrowInvalid:
                source.seek(0)
                return ipc.open_stream(source).read_all()

    whole = table()
    check_size(path, 8 * whole.num_rows * len(whole.schema))
    _add(contents, whole.schema, whole.num_rows, whole.column)


def _add(contents: Contents, schema: Any, rows: int, column: Any) -> None:
    """Numeric columns and those of times."""
    from pyarrow import types

    durations: list[str] = []
    for one in schema:
        metadata = one.metadata or {}
        unit = next((metadata[key].decode(errors="replace") for key in (b"unit", b"units") if key in metadata), "")
        if types.is_duration(one.type):
            durations.append(one.name)
        elif types.is_timestamp(one.type) or types.is_integer(one.type) or types.is_floating(one.type):
            name = "time" if types.is_timestamp(one.type) else one.name
            contents.add(name, (rows,), partial(_numbers, column, one.name), unit)
    if durations and not any(signal.is_time for signal in contents.signals):  # others may be delays of something
        contents.add("time", (rows,), partial(_numbers, column, durations[0]))


def _numbers(read: Any, name: str) -> Any:
    """Values of a column; what is missing is not a number."""
    from pyarrow import types

    column = read(name)
    if types.is_timestamp(column.type):
        return column.cast("timestamp[ns]").to_numpy()
    if types.is_duration(column.type):
        return column.cast("duration[ns]").to_numpy()
    return np.asarray(column.to_numpy())
