"""Writes columns as a Parquet file that any reader of Parquet reads."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
import orjson
from numpy.typing import NDArray

from acqd import __version__
from acqd.dataset.parquet import layout
from acqd.dataset.parquet.thrift import I32, Structure, encoded
from acqd.varint import varint

_GROUP_ROWS = 1_000_000
"""Rows that are written at a time: 8 MB of a column."""
_LEVEL = 1
"""Of zlib: higher ones take twice the time for a few per cent."""
_KINDS = {"b": layout.BOOLEAN, "i": layout.INT64, "M": layout.INT64, "f": layout.DOUBLE, "O": layout.BYTE_ARRAY}
_UTC_NS: Structure = {8: {1: True, 2: {3: {}}}}
"""LogicalType TIMESTAMP, adjusted to UTC, in nanoseconds."""
_TEXT: Structure = {1: {}}


def write_parquet(path: Path, columns: Mapping[str, NDArray[Any]], units: Mapping[str, str] | None = None) -> None:
    """Write `columns` [rows] of float, int, bool, datetime64[ns] (UTC) or str to `path`; `units` go into the metadata.

    Raises OSError; ValueError for columns of different lengths or other types.
    """
    kinds = {name: _KINDS[values.dtype.kind] for name, values in columns.items()}
    lengths = {len(values) for values in columns.values()}
    if len(lengths) != 1:
        raise ValueError(f"columns of different lengths: {sorted(lengths)}")
    rows = lengths.pop()
    with path.open("wb") as file:
        file.write(layout.MAGIC)
        groups = [
            _row_group(file, {name: values[start : start + _GROUP_ROWS] for name, values in columns.items()}, kinds)
            for start in range(0, max(rows, 1), _GROUP_ROWS)
        ]
        footer = encoded(
            {
                1: I32(2),
                2: [{4: "schema", 5: I32(len(columns))}, *(_element(n, kinds[n], v) for n, v in columns.items())],
                3: rows,
                4: groups,
                5: [{1: layout.UNITS, 2: orjson.dumps(dict(units))}] if units else None,
                6: f"{layout.WRITER} version {__version__}",
            }
        )
        file.write(footer + struct.pack("<I", len(footer)) + layout.MAGIC)


def _element(name: str, kind: int, values: NDArray[Any]) -> Structure:
    """SchemaElement of a column."""
    text = values.dtype.kind == "O"
    logical = _UTC_NS if values.dtype.kind == "M" else _TEXT if text else None
    return {1: I32(kind), 3: I32(layout.REQUIRED), 4: name, 6: I32(0) if text else None, 10: logical}


def _row_group(file: BinaryIO, columns: Mapping[str, NDArray[Any]], kinds: Mapping[str, int]) -> Structure:
    chunks = [_chunk(file, name, values, kinds[name]) for name, values in columns.items()]
    size = sum(chunk[3][6] for chunk in chunks)
    return {1: chunks, 2: size, 3: len(next(iter(columns.values())))}


def _chunk(file: BinaryIO, name: str, values: NDArray[Any], kind: int) -> Structure:
    """Writes a column of a row group; its ColumnChunk."""
    start, dictionary, encoding, plain_size = file.tell(), None, layout.PLAIN, 0
    if kind == layout.BYTE_ARRAY:
        texts, content = _numbered(values)
        encoding, dictionary = layout.RLE_DICTIONARY, start
        head = {7: {1: I32(len(texts)), 2: I32(layout.PLAIN)}}
        plain_size += _page(file, layout.DICTIONARY_PAGE, b"".join(map(_byte_array, texts)), head)
    elif kind == layout.BOOLEAN:
        content = np.packbits(values, bitorder="little").tobytes()
    else:
        content = values.astype("<f8" if kind == layout.DOUBLE else "<i8").tobytes()
    data = file.tell()
    head = {5: {1: I32(len(values)), 2: I32(encoding), 3: I32(layout.RLE), 4: I32(layout.RLE)}}
    plain_size += _page(file, layout.DATA_PAGE, content, head)
    encodings = [I32(each) for each in sorted({layout.PLAIN, layout.RLE, encoding})]
    metadata = {
        1: I32(kind), 2: encodings, 3: [name], 4: I32(layout.GZIP), 5: len(values), 6: plain_size,
        7: file.tell() - start, 9: data, 11: dictionary,
    }  # fmt: skip
    return {2: start, 3: metadata}


def _page(file: BinaryIO, kind: int, content: bytes, head: Structure) -> int:
    """Writes a page; its size, without compression."""
    packer = zlib.compressobj(_LEVEL, zlib.DEFLATED, layout.GZIP_WINDOW)
    packed = packer.compress(content) + packer.flush()
    header = encoded({1: I32(kind), 2: I32(len(content)), 3: I32(len(packed)), **head})
    file.write(header + packed)
    return len(header) + len(content)


def _numbered(values: NDArray[Any]) -> tuple[list[str], bytes]:
    """The different texts, and their number in each row as one run of packed bits: their width, length, numbers."""
    numbers = {text: k for k, text in enumerate(dict.fromkeys(values.tolist()))}
    width = next(bits for bits in layout.INDEX_TYPES if len(numbers) <= 1 << bits)
    groups = -(-len(values) // 8)
    packed = np.zeros(8 * groups, dtype=layout.INDEX_TYPES[width])
    packed[: len(values)] = [numbers[text] for text in values.tolist()]
    return list(numbers), bytes([width]) + varint(groups << 1 | 1) + packed.tobytes()


def _byte_array(text: str) -> bytes:
    data = text.encode()
    return struct.pack("<I", len(data)) + data
