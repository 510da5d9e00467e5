"""Elements of a MATLAB file of level 5, walked before SciPy reads it: codes of types that it takes without looking.

SciPy looks up the type of a numeric part by the code in the file, and a code without a type ends the process.
(MathWorks, MAT-file format, level 5: data elements.)
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO

_HEADER = 128
_ORDER = {b"IM": "<", b"MI": ">"}
_MATRIX, _COMPRESSED = 14, 15
_NUMBERS = frozenset((*range(1, 8), 9, 12, 13, 16, 17, 18))
"""Codes of numbers and texts."""
_LEAVES = frozenset(range(4, 16))
"""Classes of arrays that hold numbers or texts, and no other arrays."""
_DEEPEST = 64
_PIECE = 1 << 16

Read = Callable[[int], bytes]


def check_elements(path: Path) -> None:
    """Raises ValueError for an element that SciPy must not see. Other levels have none."""
    with path.open("rb") as file:
        order = _ORDER.get(file.read(_HEADER)[126:])
        if order is None:
            return
        while len(tag := file.read(8)) == 8:
            kind, size = struct.unpack(order + "II", tag)
            end = file.tell() + size
            if kind == _COMPRESSED:
                _matrix(_Inflated(file, size).read, order)
            elif kind == _MATRIX:
                _matrix_parts(file.read, size, order, 0)
            file.seek(end)


def _matrix(read: Read, order: str) -> None:
    tag = read(8)
    if len(tag) == 8 and struct.unpack(order + "II", tag)[0] == _MATRIX:
        _matrix_parts(read, struct.unpack(order + "II", tag)[1], order, 0)


def _matrix_parts(read: Read, size: int, order: str, depth: int) -> None:
    """The parts of an array: flags with its class, then sizes, name and numbers, or other arrays."""
    if depth > _DEEPEST:
        raise ValueError("arrays within arrays without end")
    left, kind_of_array = size, -1
    while left >= 8:
        tag = read(8)
        if len(tag) < 8:
            return  # cut off: SciPy says so
        left -= 8
        kind, length = struct.unpack(order + "II", tag)
        if kind >> 16:  # a small element, whose content is in the tag
            kind, length = kind & 0xFFFF, 0
        nested = kind == _MATRIX and kind_of_array not in _LEAVES and kind_of_array >= 0
        if not nested and kind not in _NUMBERS:
            raise ValueError(f"an array has a part of type {kind}, which there is not")
        if length > left:
            raise ValueError(f"a part of {length} bytes in an array that has {left} left")
        if nested:
            _matrix_parts(read, length, order, depth + 1)
        else:
            content = _skipped(read, length + -length % 8)
            if kind_of_array < 0:
                kind_of_array = struct.unpack(order + "I", content.ljust(4, b"\0"))[0] & 0xFF
        left -= length + -length % 8


def _skipped(read: Read, length: int) -> bytes:
    """Reads so many bytes and returns the first four."""
    first = read(min(length, _PIECE))
    length -= len(first)
    while length > 0 and (piece := read(min(length, _PIECE))):
        length -= len(piece)
    return first[:4]


class _Inflated:
    """The content of a compressed element, piece by piece."""

    def __init__(self, file: BinaryIO, size: int) -> None:
        self._file, self._left = file, size
        self._inflate = zlib.decompressobj()
        self._tail = b""

    def read(self, length: int) -> bytes:
        """So many bytes, or fewer at the end."""
        found = b""
        while len(found) < length and not self._inflate.eof:
            if not self._tail:
                self._tail = self._file.read(min(_PIECE, self._left))
                self._left -= len(self._tail)
                if not self._tail:
                    break
            try:
                found += self._inflate.decompress(self._tail, length - len(found))
            except zlib.error as error:
                raise ValueError(str(error)) from None
            self._tail = self._inflate.unconsumed_tail
        return found
