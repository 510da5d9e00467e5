"""Reads Parquet files that `write_parquet` has written; a damaged one raises ValueError, whatever is damaged."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np
from numpy.typing import NDArray

from acqd.dataset.parquet import layout
from acqd.dataset.parquet.thrift import Reader, Structure
from acqd.errors import InputError
from acqd.parquet_size import MOST_CELLS, check_cells

_END_BYTES = 8
_PACKED = 1100
"""Bytes that one byte of a gzip stream holds at most (1032)."""
_MOST_TEXT = 8 * MOST_CELLS
"""Bytes of the different texts of a column: as much memory as the most numbers that are read at once."""


class OtherWriterError(Exception):
    """The file is Parquet of another program, whose codings are not read here."""


def read_parquet(path: Path) -> dict[str, NDArray[Any]]:
    """Columns [rows] by name: float64, int64, bool, datetime64[ns] (UTC), texts as objects.

    Raises OSError, ValueError (damaged), OtherWriterError, InputError (more than is read at once).
    """
    with path.open("rb") as file:
        size = file.seek(0, 2)
        footer = _footer(file, size)
        try:
            return _columns(path, file, size, footer)
        except InputError:
            raise
        except (KeyError, IndexError, TypeError, AttributeError, ValueError, zlib.error, struct.error) as error:
            raise ValueError(f"it is damaged: {error or type(error).__name__}") from None


def _footer(file: BinaryIO, size: int) -> Structure:
    """FileMetaData at the end of a file of `size` bytes."""
    file.seek(max(0, size - _END_BYTES))
    length, magic = struct.unpack("<I4s", file.read(_END_BYTES).rjust(_END_BYTES, b"\0"))
    if magic != layout.MAGIC or length + _END_BYTES + len(layout.MAGIC) > size:
        raise ValueError("it has not the end of a Parquet file")
    file.seek(size - _END_BYTES - length)
    return Reader(file.read(length)).structure()


def _columns(path: Path, file: BinaryIO, size: int, footer: Structure) -> dict[str, NDArray[Any]]:
    writer = footer.get(6, b"").decode(errors="replace")
    if writer.split(" ")[0] != layout.WRITER:
        raise OtherWriterError(f"written by {writer[:40] or 'an unknown program'}")
    elements, rows = footer[2][1:], footer[3]
    check_cells(path, rows, len(elements))
    names = [element[4].decode() for element in elements]
    counts = [group[3] for group in footer[4]]
    if sum(counts) != rows or min(counts) < 0 or len(set(names)) != len(names):
        raise ValueError("its metadata contradict each other")
    return {
        name: np.concatenate([_values(file, size, element, group[1][k][3], group[3]) for group in footer[4]])
        for k, (name, element) in enumerate(zip(names, elements, strict=True))
    }


def _values(file: BinaryIO, size: int, element: Structure, chunk: Structure, rows: int) -> NDArray[Any]:
    """[rows] of a column in a row group."""
    kind, start = element[1], chunk[11 if 11 in chunk else 9]
    if not 0 <= start <= start + chunk[7] <= size:
        raise ValueError("a column outside the file")
    file.seek(start)
    data = file.read(chunk[7])
    texts, after = None, 0
    if kind == layout.BYTE_ARRAY:
        content, after, head = _page(data, 0, min(_PACKED * len(data), _MOST_TEXT))
        texts = _texts(content, head[7][1])
    most = {layout.BOOLEAN: rows // 8 + 1, layout.BYTE_ARRAY: 4 * rows + 64}.get(kind, 8 * rows)
    content, _, _ = _page(data, after, most)
    if kind == layout.BOOLEAN:
        return np.unpackbits(np.frombuffer(content, np.uint8), count=rows, bitorder="little").astype(bool)
    if texts is not None:
        return texts[_numbers(content, rows)]
    values = np.frombuffer(content, "<f8" if kind == layout.DOUBLE else "<i8", count=rows)
    return values.astype("datetime64[ns]" if 10 in element else values.dtype.newbyteorder("="))


def _page(data: bytes, start: int, most: int) -> tuple[bytes, int, Structure]:
    """The content, of at most `most` bytes, of the page at `start` in a chunk, where it ends, and its header."""
    reader = Reader(data, start)
    head = reader.structure()
    end = reader.position + head[3]
    if head[2] > most or not reader.position <= end <= len(data):
        raise ValueError("a page of an impossible size")
    unpacker = zlib.decompressobj(layout.GZIP_WINDOW)
    content = unpacker.decompress(data[reader.position : end], head[2] + 1)
    if not unpacker.eof or len(content) != head[2]:  # at its end, zlib has compared the sum of the stream
        raise ValueError("a page that is not whole")
    return content, end, head


def _texts(content: bytes, count: int) -> NDArray[Any]:
    """The different texts of a column."""
    texts, at = [], 0
    for _ in range(count):
        (length,) = struct.unpack_from("<I", content, at)
        texts.append(content[at + 4 : at + 4 + length].decode())
        at += 4 + length
    return np.array(texts, dtype=object)


def _numbers(content: bytes, rows: int) -> NDArray[np.int64]:
    """[rows] numbers of texts, in one run of packed bits."""
    dtype = layout.INDEX_TYPES[content[0]]
    reader = Reader(content, 1)
    if reader.varint() != -(-rows // 8) << 1 | 1:
        raise ValueError("a column of texts with another number of rows")
    return np.frombuffer(content, dtype, count=rows, offset=reader.position).astype(np.int64)
